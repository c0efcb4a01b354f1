"""Nothing on a page contradicts anything else: reports of every kind, number against number."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from functools import partial
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from fake_analysis import CASES, fake_analysis, fake_closed
from fake_study import fake_study

from bayeshaptic.effects.library import effects
from bayeshaptic.inference.next_experiment import Experiment
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.report import write, write_report
from bayeshaptic.report.figures import FORCE_PICTURES, LOOP_PICTURES, PICTURES, style
from bayeshaptic.report.guidance.words import _next, experiment_rows
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop.tables import outcomes
from bayeshaptic.report.numbers.misfit import misfit_is_clear
from bayeshaptic.report.numbers.quantities import estimate
from bayeshaptic.report.numbers.trust import doubtful_parameters
from bayeshaptic.report.page import section
from bayeshaptic.report.study import write as study_write
from bayeshaptic.report.study.words import configurations
from bayeshaptic.report.walls.section import table_of
from bayeshaptic.stability.guidance.shares import VarianceShares

KINDS: dict[str, Callable[[], Any]] = {
    **{name: partial(fake_analysis, **options) for name, options in CASES.items()},
    "consistent": partial(fake_closed, "consistent", "linear"),
    **{
        f"{verdict} {family}": partial(fake_closed, verdict, family)
        for verdict in ("explained", "unexplained")
        for family in ("linear", "nonlinear", "time-varying")
    },
    "explained, and yet not": partial(fake_closed, misfit=1.5),
    "far off": partial(fake_closed, "unexplained", misfit=13.0),
}
_DOT = style.drawn(style.new_figure(0.5, 0.5), "dot")


@pytest.fixture(autouse=True)
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Words and numbers only; the figures have tests of their own."""
    every = (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES)
    monkeypatch.setattr(write, "draw_pictures", lambda result: {p.name: _DOT for p in every})
    monkeypatch.setattr(section, "drawn", lambda figure, name: _DOT)
    monkeypatch.setattr(write, "guidance_section", lambda case, analysis: None)
    monkeypatch.setattr(Posterior, "save", lambda posterior, path: None)
    monkeypatch.setattr(write, "table_of", partial(table_of, draws=60))
    monkeypatch.setattr(study_write, "table_of", partial(table_of, draws=60))


@pytest.fixture(params=KINDS)
def kind(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[tuple[Any, Path]]:
    """A result, and the folder of its report."""
    result = KINDS[request.param]()
    write_report(result, tmp_path)
    yield result, tmp_path


def page_of(folder: Path) -> str:
    page = (folder / "report.html").read_text(encoding="utf-8")
    page = re.sub(r"<(style|script).*?</\1>", "", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", page)).split())


def numbers_of(folder: Path, name: str = "summary.json") -> Any:
    return json.loads((folder / name).read_text(encoding="utf-8"))


def test_one_page_one_truth(kind: tuple[Any, Path]) -> None:
    """All of it on one rendering: that is what takes the time."""
    result, folder = kind
    page, found, limits = page_of(folder), numbers_of(folder), numbers_of(folder, "limits.json")
    _the_sentence_is_what_the_files_say(result, page, found, limits)
    _what_is_stated_is_stated_everywhere(page, found, limits)
    _the_limit_is_one(result, page, found)
    _the_verdict_is_one(result, page, found)
    _doubtful_parameters_are_said_so(result, page, found)
    _effects_are_named_in_words(page)


def _same(one: float | None, other: float | None) -> None:
    """Equal to the digits of limits.json; or both missing."""
    assert one == (other if other is None else pytest.approx(other, rel=1e-5))


def _the_sentence_is_what_the_files_say(result: Any, page: str, found: Any, limits: Any) -> None:
    head = headline(result)
    said = found["recommendation"]
    assert head.sentence in page and said["sentence"] == head.sentence
    assert limits["status"] == said["status"]
    _same(limits["recommended"], said["stiffness"])
    if said["status"] == "untrusted":
        assert said["stiffness"] is None
    elif said["risk"] is not None:
        safe = found["critical_stiffness"]["safe"][f"{said['risk']:g}"]
        assert said["stiffness"] <= safe
        assert safe == pytest.approx(said["stiffness"], rel=0.02)


def _what_is_stated_is_stated_everywhere(page: str, found: Any, limits: Any) -> None:
    for risk, stiffness in found["critical_stiffness"]["safe"].items():
        _same(limits["stiffness"][risk], stiffness)
        for part in limits["boundaries"]:
            column = part["stiffness"][risk]
            if stiffness is None:
                assert column is None
            elif column is not None:
                assert column[0] == pytest.approx(stiffness, rel=1e-5)
    unstated = None in found["critical_stiffness"]["safe"].values()
    assert ("too few draws to say" in page) >= unstated


def _the_limit_is_one(result: Any, page: str, found: Any) -> None:
    limit = found["critical_stiffness"]
    after = found["error"]["after"]["critical_stiffness"]
    if after["q50"] is not None:
        assert after == pytest.approx({q: limit[q] for q in after})
    if result.closed is not None and result.closed.effects:  # type: ignore[union-attr]
        shown = estimate(limit["q50"], limit["q05"], limit["q95"], limit["unit"])
        assert shown in page  # the table of errors has the limit of the table of limits
    stages = result.analysis.seconds
    assert len(re.findall(r"draws in [\d.]+ m?s\b", page)) == 0
    assert all(page.count(f"{name} {spent:.1f} s") == 1 for name, spent in stages.items())


def _the_verdict_is_one(result: Any, page: str, found: Any) -> None:
    closed = result.closed
    if misfit_is_clear(result.analysis):
        assert "What is left is noise" not in page and "explains the recording" not in page
    if closed is None:
        return
    for row in outcomes(closed):
        for said, threshold in zip(row[2::2], row[3::2], strict=True):
            number = said.replace(", beyond", "").replace("\N{MINUS SIGN}", "-").replace(",", "")
            if threshold != "\N{EN DASH}":
                assert said.endswith("beyond") == (float(number) > float(threshold))
    if closed.verdict == "unexplained":
        assert "explains the recording" not in page


def _doubtful_parameters_are_said_so(result: Any, page: str, found: Any) -> None:
    doubtful = doubtful_parameters(result)
    rows = found["posterior"]["parameters"]
    assert {name for name, row in rows.items() if not row["trusted"]} == set(doubtful)
    assert len(re.findall(r"not to be trusted\)", page)) == len(doubtful)
    if found["diagnosis"]["verdict"] == "unexplained" or misfit_is_clear(result.analysis):
        assert set(doubtful) == set(rows)


def _effects_are_named_in_words(page: str) -> None:
    for effect in effects():
        if "_" in effect.name:
            assert effect.name not in page, effect.name


def test_a_study_says_which_way_its_limit_goes(tmp_path: Path) -> None:
    study = fake_study(people=2, free=2, places=(0.0, 1.0))
    study_write.write_study_report(study, tmp_path)
    page = page_of(tmp_path)
    found, limits = numbers_of(tmp_path, "population.json"), numbers_of(tmp_path, "limits.json")
    for risk, stiffness in found["device_limit"]["safe"].items():
        _same(limits["stiffness"][risk], stiffness)
    for sentence, held in zip(configurations(study), (False, True), strict=True):
        rows = [c for c in found["configurations"] if c["held"] is held]
        first, last = (row["critical_stiffness"]["q50"] for row in (rows[0], rows[-1]))
        ends = re.search(r"goes from ([\d.]+) dB in configuration \S+ to ([\d.]+) dB", sentence)
        assert ends and sentence in page
        assert (float(ends[1]) < float(ends[2])) == (first < last)


@pytest.mark.parametrize(("beyond", "left"), [(0.0, "45 %"), (0.5, "78 %"), (1.0, "100 %")])
def test_more_data_narrow_no_more_than_the_parameters_leave_open(beyond: float, left: str) -> None:
    shares = VarianceShares((), 0.05, beyond, 1000)
    louder = Experiment("louder", "one more with twice the force", 0.02, 0.45)
    ((_, width, _),) = experiment_rows(shares, [louder])
    assert width == left
    assert _next(shares, [louder]).startswith("No further recording") == (beyond == 1.0)
