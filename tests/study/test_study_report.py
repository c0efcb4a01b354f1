"""The report of a study: what it says of people, of configurations, and of what is missing."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from browser import needs_browser, probe
from fake_analysis import fake_analysis, fake_closed
from fake_study import NAMES, SIX_DB, fake_study
from one_truth import text_of

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.report.figures.drawing.look import own_look
from bayeshaptic.report.figures.study.pictures import STUDY_PICTURES, draw_study_pictures
from bayeshaptic.report.figures.style import called
from bayeshaptic.report.figures.walls.curve import _curves
from bayeshaptic.report.headline import headline
from bayeshaptic.report.study import write as study_report
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.study.population_json import population_summary
from bayeshaptic.report.study.words import missing, people
from bayeshaptic.report.study.write import write_study_report
from bayeshaptic.report.walls.section import limits_section, table_of

SHAPES: dict[str, dict[str, Any]] = {
    "whole": {"people": 3, "free": 2, "places": (0.0, 1.0), "references": True, "failed": 1},
    "nobody": {"people": 0, "free": 1},
    "one user": {"people": 1, "free": 0},
    "people alone": {"people": 2, "free": 0},
    "nothing": {"people": 0, "free": 0, "failed": 1},
    "alike": {"people": 2, "free": 1, "device": "lhifam", "spread": 0.002},
}


@cache
def study(shape: str) -> Any:
    return fake_study(**SHAPES[shape])


@pytest.fixture(autouse=True)
def few_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """The walls of few draws: their own tests are elsewhere."""
    monkeypatch.setattr(study_report, "table_of", partial(table_of, draws=60))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a report with everything in it."""
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(study_report, "table_of", partial(table_of, draws=60))
        page = folder / "anna" / "report.html"
        write_study_report(study("whole"), folder, pages={"anna": page})
    return folder


def test_everything_is_written_and_the_page_needs_nothing_else(whole: Path) -> None:
    names = {path.name for path in whole.iterdir()}
    pictures = {f"{picture.name}.png" for picture in STUDY_PICTURES}
    assert names == pictures | {
        "report.html", "population.json", "limits.json", "limits.csv", "limits_curve.png",
        "limits_kb.png", "guidance_shares.png", "guidance_sweeps.png",
    }  # fmt: skip
    page = (whole / "report.html").read_text(encoding="utf-8")
    sources = re.findall(r'(?:src|[^:]href)="([^"]*)"', page)
    links = {s for s in sources if not s.startswith(("data:", "#"))}
    assert links == {"anna/report.html", *(names - {"report.html"})}
    assert "http" not in "".join(sources) and page.count("<script") == 1
    assert len(page) < 1_500_000


def test_the_page_names_everybody_and_what_failed(whole: Path) -> None:
    text = text_of(whole / "report.html")
    for name in (*NAMES[:3], "free-0", "free-1", "a person not yet seen", "nobody holds it"):
        assert name in text
    assert "bad-0 failed." in text and "row 3 is 'oops'" in text
    # What was recorded of somebody, and could not be used, says nothing of them.
    assert "Recordings 6, 5 of them used Held by anna, ben, carla Configurations" in text
    # Guidance is of one case, and the page is of several.
    assert "of one case, the one that sets the limit most often: " in text
    assert "Triangles: limits known from elsewhere" in text
    for title in ("The limit of the device", "People", "Configurations", "Which walls are stable",
                  "The population of hands", "What all of this assumes"):  # fmt: skip
        assert title in text


@needs_browser
@pytest.mark.parametrize("width", [1100, 420])
def test_the_page_is_laid_out_without_overlaps(whole: Path, tmp_path: Path, width: int) -> None:
    found = probe(whole / "report.html", tmp_path, width)
    assert found["overlaps"] == [] and found["width"] <= found["window"]
    assert len(found["images"]) == 7 and all(natural > 0 for _, natural, _ in found["images"])
    assert found["requests"] == []


def test_population_json_is_the_contract(whole: Path) -> None:
    found = json.loads((whole / "population.json").read_text(encoding="utf-8"))
    assert found.keys() >= {
        "device", "recordings", "users", "population", "correlation", "new_person",
        "configurations", "device_limit",
    }  # fmt: skip
    assert [user["user"] for user in found["users"]][:3] == list(NAMES[:3])
    limit = found["new_person"]["critical_stiffness"]
    assert limit.keys() >= {"unit", "q05", "q50", "q95", "db", "safe", "crossings"}
    assert limit["q05"] < limit["q50"] < limit["q95"] and limit["unit"] == "N m/rad"
    assert limit["db"]["q50"] == pytest.approx(40.8, abs=0.5)  # Table I
    assert set(found["population"]) == {"mh", "bh", "kh", "bs", "ks"}
    assert found["population"]["kh"]["log_sd"].keys() == {"q05", "q50", "q95"}
    assert len(found["correlation"]) == 5 and found["correlation"][0][0] == pytest.approx(1.0)
    assert {row["held"] for row in found["configurations"]} == {True, False}
    assert found["device_limit"]["safe"].keys() == {"0.05", "0.01", "0.001"}
    shares = [row["probability"] for row in found["device_limit"]["binding"]]
    assert sum(shares) == pytest.approx(1.0)


def test_what_a_study_lacks_is_null_and_not_absent() -> None:
    found = population_summary(study("nobody"))
    assert found["users"] == []
    for key in ("population", "correlation", "new_person", "configurations"):
        assert found[key] is None
    assert found["device_limit"]["binding"][0]["case"] == "nobody holds it"


def test_figures_have_room_for_every_name() -> None:
    """Warnings are errors here: an axis that long labels squeezed to nothing had been one."""
    found = study("people alone")
    longest = "user " + 300 * "x"
    labels = {found.users[0].label: longest, found.users[1].label: "user a$b {\\frac 日本"}
    users = tuple(replace(case, label=labels[case.label]) for case in found.users)
    cases = tuple(replace(case, label=labels.get(case.label, case.label)) for case in found.cases)
    entries = [
        replace(one, entry=replace(one.entry, user=labels[f"user {one.entry.user}"][5:]))
        for one in found.recordings
    ]
    named = replace(found, users=users, cases=cases, recordings=tuple(entries))
    with own_look():
        assert set(draw_study_pictures(named)) == {"study_limit", "study_people"}
    assert called(longest).startswith("user xxx") and len(called(longest)) < 50
    assert called("user ü") == "user ü"


def test_a_predicted_configuration_is_called_so_beside_its_curve() -> None:
    """Its name was "configuration 0.875 (…ted), nobody holds it"."""
    found = study("whole")
    label = "configuration 0.875 (predicted), nobody holds it"
    cases = tuple(replace(case, label=label) for case in found.cases[:2])
    curves = _curves(SimpleNamespace(cases=cases, samples=cases[0].limit.samples))
    assert label in [name for name, _ in curves]


def test_the_worst_case_decides_and_is_named() -> None:
    head = study_headline(study("whole"))
    assert head.risk is not None
    safe = study("whole").limit.safe(head.risk)
    number = float(re.search(r"at most ([\d.]+) N m/rad", head.sentence)[1])  # type: ignore[index]
    # Rounded down, by less than one part in a hundred.
    assert 0.99 * safe < number <= safe
    assert (
        "whether nobody, one of these 3 people or a person not yet seen holds it, in every conf"
        in head.sentence
    )
    assert head.details[0].startswith("What sets the limit: nobody holds it (100 %).")
    # There the fake device has a third less damping.
    assert "The case that does so most often: configuration 1, nobody holds it." in head.details[0]
    assert head.status == "caution"  # a recording failed


def test_people_who_hardly_move_the_limit_are_said_to() -> None:
    words = " ".join(people(study("alike")))
    assert "People hardly move the critical stiffness of this device" in words
    assert "cannot tell these people apart" in words
    moved = " ".join(people(study("whole")))
    assert "hardly" not in moved and "People move the critical stiffness" in moved


@pytest.mark.parametrize(
    ("shape", "parts"),
    [
        ("nobody", ["Nobody holds the device", "There is one configuration only"]),
        (
            "one user",
            [
                "There is one user only",
                "There is no recording without a user",
                "There is one configuration only",
            ],
        ),
        (
            "people alone",
            ["There is no recording without a user", "There is one configuration only"],
        ),
        ("whole", []),
    ],
)
def test_what_is_missing_is_said(shape: str, parts: list[str], tmp_path: Path) -> None:
    found = missing(study(shape))
    assert len(found) == len(parts)
    for sentence, part in zip(found, parts, strict=True):
        assert sentence.startswith(part)
    if parts:
        text = text_of(write_study_report(study(shape), tmp_path, walls=False))
        assert "What this study does not say" in text and parts[0] in text
        assert not (tmp_path / "limits.json").exists()


def test_a_study_without_a_usable_recording_has_no_limit(tmp_path: Path) -> None:
    text = text_of(write_study_report(study("nothing"), tmp_path))
    assert "There is no limit: no recording could be used." in text
    assert json.loads((tmp_path / "population.json").read_text())["device_limit"] is None


def test_an_untrusted_recording_makes_the_study_untrusted() -> None:
    doubtful = fake_study(people=0, free=1, converged=False)
    head = study_headline(doubtful)
    assert head.status == "untrusted" and "1 of its 1 recordings supports" in head.sentence


def test_warnings_stand_at_the_top() -> None:
    warned = replace(study("nobody"), notices=(Notice("warning", "population", "Beware of it"),))
    head = study_headline(warned)
    assert head.status == "caution" and "Beware: Beware of it." in head.details


def changed(which: Any, *results: Any) -> Any:
    """A study with other results of its recordings, in their order."""
    both = zip(which.recordings, results, strict=True)
    return replace(which, recordings=tuple(replace(one, result=found) for one, found in both))


def test_a_study_is_no_better_than_its_recordings(tmp_path: Path) -> None:
    one = study("nobody")
    assert study_headline(one).status == "safe"
    closed = fake_closed("unexplained", "linear", device="phantom")
    assert headline(closed).status == "caution"
    head = study_headline(changed(one, closed))
    assert head.status == "caution" and "unexplained" in head.doubts
    assert "Part of its recording remains unexplained" in head.sentence
    write_study_report(changed(one, closed), tmp_path)
    assert json.loads((tmp_path / "limits.json").read_text())["status"] == "caution"
    said = json.loads((tmp_path / "population.json").read_text())["recommendation"]
    assert said["status"] == "caution" and "unexplained" in said["sentence"]


def test_what_recordings_warn_of_stands_at_the_top_of_their_study() -> None:
    text = "Dry friction is not taken off, and makes the limit too high"
    warned = partial(fake_analysis, "free", "phantom", spread=0.01)
    doubtful, clean = warned(notices=(Notice("warning", "pieces", text),)), warned()
    head = study_headline(changed(study("nobody"), doubtful))
    assert head.status == "caution" and f"Beware: {text}." in head.details
    two = fake_study(people=0, free=2)
    assert study_headline(two).status == "safe"
    head = study_headline(changed(two, clean, doubtful))
    assert head.status == "caution" and f"Beware: {text}." in head.details
    head = study_headline(changed(two, doubtful, doubtful))
    assert "free-0 (pieces) and free-1 (pieces)" in " ".join(head.details)


def test_a_measurement_that_puts_the_limit_lower_lowers_that_of_the_study() -> None:
    analysis = fake_analysis("free", "phantom", spread=0.01)
    low = 0.8 * analysis.limit.quantile(0.5)
    own = {"q05": 0.98 * low, "q50": low, "q95": 1.02 * low}
    analysis.etfe_limit = replace(analysis.etfe_limit, **own)
    head = study_headline(changed(study("nobody"), analysis))
    assert head.status == "caution" and head.risk is None
    assert head.stiffness == headline(analysis).stiffness
    assert "the measured response of free-0 itself" in head.sentence


def test_an_older_report_leaves_nothing_that_contradicts(whole: Path, tmp_path: Path) -> None:
    for name in ("study_people.png", "limits.json", "index.html", "notes.txt"):
        (tmp_path / name).write_text('"format": "bayeshaptic limits 1"')
    write_study_report(study("nobody"), tmp_path, walls=False)
    left = {path.name for path in tmp_path.iterdir()}
    assert left == {"report.html", "population.json", "study_limit.png", "notes.txt"}


def test_an_interrupted_run_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "report.html").write_text("old")

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(study_report, "population_json", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_study_report(study("nobody"), tmp_path, walls=False)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == "old"


def test_a_file_in_the_way_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(InputError, match="is a file"):
        write_study_report(study("nobody"), tmp_path / "out")


def test_references_are_drawn_where_they_are() -> None:
    from bayeshaptic.report.figures.study import people as study_people

    figure = study_people.draw(study("whole"))
    (line,) = [line for line in figure.axes[0].lines if line.get_marker() == "v"]
    assert sorted(line.get_xdata()) == pytest.approx(sorted(SIX_DB))
    low, high = figure.axes[0].get_xlim()
    assert low < min(SIX_DB) and high > max(SIX_DB)


def test_the_section_of_walls_takes_all_cases() -> None:
    table = table_of(study("nobody").cases, draws=60)
    assert "Which walls are stable" in limits_section(table).html
