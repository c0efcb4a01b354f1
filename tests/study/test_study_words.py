"""The sentences of a study's page."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_study import fake_study

from bayeshaptic.recordings.study import StudyEntry
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.study.population_json import population_summary
from bayeshaptic.report.study.tables import users
from bayeshaptic.report.study.words import people


def test_people_hardly_move_the_limit_only_where_rare_ones_do_not_either() -> None:
    """Three users were said not to matter, where one in a thousand had half of the limit."""
    alike = fake_study(people=2, device="lhifam", spread=0.002)
    case = alike.new_person[0]
    assert "More people would not narrow it" in " ".join(people(alike))
    samples = np.tile(case.limit.samples, 200)
    samples[::500] *= 0.5
    limit = replace(case.limit, samples=samples, chains=len(samples))
    words = " ".join(people(replace(alike, new_person=(replace(case, limit=limit),))))
    assert "People hardly move" in words and "does not matter" not in words
    assert "That does not hold of everybody: of one person in a thousand it is below" in words


def test_people_are_known_by_their_names_and_not_by_how_labels_begin() -> None:
    """Of Ana's limit that of "ana (left)" was a part; who is not in the population was no one."""
    three = fake_study(people=3)
    names = ("ana", "ana (left)", "ana, b")
    apart = replace(three.users[2], user=names[2], label=f"user {names[2]}")
    inside = tuple(
        replace(case, user=name, label=f"user {name}")
        for case, name in zip(three.users[:2], names, strict=False)
    )
    entries = tuple(StudyEntry(Path(f"{name}.csv"), name) for name in names)
    named = replace(
        three,
        users=inside,
        cases=(*inside, apart),
        study=replace(three.study, entries=entries),
        recordings=tuple(
            replace(one, entry=entry)
            for one, entry in zip(three.recordings[-3:], entries, strict=True)
        ),
    )
    found = {one["user"]: one["critical_stiffness"] for one in population_summary(named)["users"]}
    for case, name in zip(named.cases, names, strict=True):
        assert found[name]["q50"] == pytest.approx(case.limit.quantile(0.5), rel=1e-3)
    rows = {row[0]: row[1:] for row in users(named)}
    assert list(rows) == list(names) and rows["ana, b"][1] == "not in the population"
    lowest = min(named.cases, key=lambda case: case.limit.quantile(0.5)).user
    assert f"{lowest} has the lowest limit" in " ".join(people(named))


@pytest.mark.parametrize(
    ("ways", "end"),
    [
        ((), "a person not yet seen holds it."),
        ((0,), "holds it (every configuration with nobody holding it, else those recorded)."),
        ((1,), "holds it (every configuration with somebody holding it, else those recorded)."),
        ((0, 1), "holds it, in every configuration."),
    ],
)
def test_every_configuration_is_that_of_whoever_was_recorded_along(
    ways: tuple[int, ...], end: str
) -> None:
    """Nobody along a coordinate, and people in one place: it was said of people, too."""
    whole = fake_study(people=3, free=2, places=(0.0, 1.0))
    along = tuple(whole.configurations[number] for number in ways)
    told = study_headline(replace(whole, configurations=along)).sentence
    assert told.endswith(end)
