"""Nothing on a page contradicts anything else: reports of every kind, number against number."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_analysis import CASES, fake_analysis, fake_closed
from fake_study import fake_study
from one_truth import check_page, numbers_of, page_of, same, words_only

from bayeshaptic.errors import Notice
from bayeshaptic.inference.next_experiment import Experiment
from bayeshaptic.report import write_report
from bayeshaptic.report.figures.study import (
    configurations as study_configurations,
    limit as study_limit,
    people as study_people,
)
from bayeshaptic.report.guidance.words import _next, experiment_rows
from bayeshaptic.report.study import tables, write as study_write
from bayeshaptic.report.study.words import configurations
from bayeshaptic.stability.guidance.shares import VarianceShares

NOT_NOISE = Notice("warning", "residual", "The residual is not noise: a force like v|v|.")


def _decades_away(make: Callable[[], Any]) -> Any:
    """A result whose limit is nothing that was measured."""
    result = make()
    one = result.analysis
    one.limit = replace(one.limit, samples=one.limit.samples * 1e-120)
    return result


KINDS: dict[str, Callable[[], Any]] = {
    **{name: partial(fake_analysis, **options) for name, options in CASES.items()},
    "consistent": partial(fake_closed, "consistent", "linear"),
    **{
        f"{verdict} {family}": partial(fake_closed, verdict, family)
        for verdict in ("explained", "unexplained")
        for family in ("linear", "nonlinear", "time-varying")
    },
    "explained, and yet not": partial(fake_closed, misfit=1.5),
    "periodic": partial(fake_analysis, period_lines=60),
    "residual that is not noise": partial(fake_analysis, notices=(NOT_NOISE,)),
    "decades away": partial(_decades_away, fake_analysis),
    "decades away, closed": partial(_decades_away, partial(fake_closed, "unexplained")),
    "far off": partial(fake_closed, "unexplained", misfit=13.0),
}


@pytest.fixture(autouse=True)
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    words_only(monkeypatch)


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Any, Path]]:
    """A result, and the folder of its report."""
    result = KINDS[request.param]()
    write_report(result, tmp_path)
    yield result, tmp_path


def test_one_page_one_truth(kind: tuple[Any, Path]) -> None:
    check_page(*kind)


def test_a_study_says_which_way_its_limit_goes(tmp_path: Path) -> None:
    study = fake_study(people=2, free=2, places=(0.0, 1.0))
    study_write.write_study_report(study, tmp_path)
    page = page_of(tmp_path)
    found, limits = numbers_of(tmp_path, "population.json"), numbers_of(tmp_path, "limits.json")
    for risk, stiffness in found["device_limit"]["safe"].items():
        same(limits["stiffness"][risk], stiffness)
    stated = re.search(r"Render walls of at most ([^(]+) \(", page)
    assert stated and page.count(stated[1]) >= 3  # the sentence, the table, the walls
    for sentence, held in zip(configurations(study), (False, True), strict=True):
        rows = [c for c in found["configurations"] if c["held"] is held]
        first, last = (row["critical_stiffness"]["q50"] for row in (rows[0], rows[-1]))
        ends = re.search(r"goes from ([\d.]+) dB in configuration \S+ to ([\d.]+) dB", sentence)
        assert ends and sentence in page
        assert (float(ends[1]) < float(ends[2])) == (first < last)


def _points(figure: Any, axis: int) -> set[str]:
    """Every single point of a figure along an axis, to two decimals."""
    lines = [line for axes in figure.axes for line in axes.lines]
    lines += [box.lines[0] for axes in figure.axes for box in axes.containers if box.lines[0]]
    data = [np.atleast_1d(line.get_data()[axis]) for line in lines]
    return {f"{values[0]:.2f}" for values in data if len(values) == 1}


def test_the_figures_of_a_study_say_what_its_tables_say(tmp_path: Path) -> None:
    study = fake_study(people=2, free=2, places=(0.0, 1.0))
    study_write.write_study_report(study, tmp_path)
    page, found = page_of(tmp_path), numbers_of(tmp_path, "population.json")
    figure = study_limit.draw(study)
    labels = {tick.get_text() for tick in figure.axes[0].get_yticklabels()}
    shown = {case.label for case in study_limit.shown_cases(study)}
    rows = [row for row in tables.binding(study) if row[0] in shown]
    assert rows and {f"{case}  ({probability})" for case, _, _, probability in rows} <= labels
    assert {middle for _, middle, _, _ in rows} <= _points(figure, 0)
    assert all(" ".join(row) in page for row in rows)
    users = tables.users(study)
    assert {row[2] for row in users} <= _points(study_people.draw(study), 0)
    assert all(" ".join(row) in page for row in users)
    drawn = {
        f"{value:.2f}"
        for axes in study_configurations.draw(study).axes
        for line in axes.lines
        for value in line.get_ydata()
    }
    for row in found["configurations"]:
        assert f"{20 * np.log10(row['critical_stiffness']['q50']):.2f}" in drawn


@pytest.mark.parametrize(("beyond", "left"), [(0.0, ["45 %"]), (0.5, ["78 %"]), (1.0, [])])
def test_more_data_narrow_no_more_than_the_parameters_leave_open(
    beyond: float, left: list[str]
) -> None:
    shares = VarianceShares((), 0.05, beyond, 1000)
    louder = Experiment("louder", "one more with twice the force", 0.02, 0.45)
    rows = experiment_rows(shares, [louder])
    assert [width for _, width, _ in rows] == left
    assert _next(shares, [louder]).startswith("No further recording") == (beyond == 1.0)
