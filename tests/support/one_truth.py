"""One page, one truth: what a report's sentences, tables and files say, number against number."""

from __future__ import annotations

import json
import re
from functools import partial
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from bayeshaptic.effects.library import effects
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.jobs.index import row_of
from bayeshaptic.quantities import estimate, rounded_down
from bayeshaptic.report import write
from bayeshaptic.report.figures import style
from bayeshaptic.report.figures.pictures import FORCE_PICTURES, LOOP_PICTURES, PICTURES
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop.tables import outcomes
from bayeshaptic.report.numbers.misfit import misfit_is_clear, residual_is_noticed
from bayeshaptic.report.numbers.trust import doubtful_parameters
from bayeshaptic.report.page import section
from bayeshaptic.report.page.lights import lights
from bayeshaptic.report.page.methods import methods
from bayeshaptic.report.study import write as study_write
from bayeshaptic.report.walls.section import table_of

_WITH_STIFFNESS = ("answer", "answer_narrow", "loop_stiffness")
_STIFFNESS = re.compile(r"([\d.]+)(?: \(([\d.]+) to ([\d.]+)\))? ([kM]?[NA](?: m)?/(?:m|rad))")
_DOT = style.drawn(style.new_figure(0.5, 0.5), "dot")


def words_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports of words and numbers only; the figures have tests of their own."""
    every = (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES)
    monkeypatch.setattr(write, "draw_pictures", lambda result: {p.name: _DOT for p in every})
    monkeypatch.setattr(section, "drawn", lambda figure, name: _DOT)
    monkeypatch.setattr(write, "guidance_section", lambda case, analysis: None)
    monkeypatch.setattr(Posterior, "save", lambda posterior, path: None)
    monkeypatch.setattr(write, "table_of", partial(table_of, draws=60))
    monkeypatch.setattr(study_write, "table_of", partial(table_of, draws=60))


def page_of(folder: Path) -> str:
    return text_of(folder / "report.html")


def text_of(path: Path) -> str:
    """What a reader sees of a page, in one line."""
    page = path.read_text(encoding="utf-8")
    page = re.sub(r"<(style|script).*?</\1>|</?code>", "", page, flags=re.DOTALL)
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", page)).split())


def numbers_of(folder: Path, name: str = "summary.json") -> Any:
    return json.loads((folder / name).read_text(encoding="utf-8"))


def check_page(result: Any, folder: Path) -> None:
    """All of it on one rendering: that is what takes the time."""
    page, found, limits = page_of(folder), numbers_of(folder), numbers_of(folder, "limits.json")
    _the_sentence_is_what_the_files_say(result, page, found, limits)
    _what_is_stated_is_stated_everywhere(page, found, limits)
    _the_limit_is_one(result, page, found)
    _the_verdict_is_one(result, page, found)
    _doubtful_parameters_are_said_so(result, page, found)
    _effects_are_named_in_words(page)
    _methods_are_those_of_this_run(result, page, found)
    _the_index_says_no_more(found, folder)
    _every_file_is_there(folder)
    _figures_say_what_the_tables_say(result, page)


def figure_texts(picture: Any, result: Any) -> list[str]:
    """What stands in a figure, line by line."""
    from matplotlib.text import Text

    figure = picture.draw(result)
    names = [getattr(axes.yaxis.get_major_formatter(), "seq", ()) for axes in figure.axes]
    found = [text.get_text() for text in figure.findobj(Text)] + [n for row in names for n in row]
    return [line for text in found for line in text.split("\n") if line.strip()]


def _figures_say_what_the_tables_say(result: Any, page: str) -> None:
    """Every stiffness that is written into a figure is on the page in the same digits."""
    closed = result.closed
    pictures = PICTURES if closed is None or closed.force else (*PICTURES, *LOOP_PICTURES)
    for picture in pictures:
        if picture.name not in _WITH_STIFFNESS or not picture.shown(result):
            continue
        said = [text for text in figure_texts(picture, result) if _STIFFNESS.fullmatch(text)]
        assert said, picture.name
        for text in said:
            assert text in page or _as_a_row(text, page), (picture.name, text)


def _as_a_row(text: str, page: str) -> bool:
    """A row of a table has the unit behind each number, and the lowest first."""
    *numbers, unit = _STIFFNESS.fullmatch(text).groups()  # type: ignore[union-attr]
    middle, *ends = (number for number in numbers if number)
    order = (ends[0], middle, ends[1]) if ends else ("\N{EN DASH}", middle, "\N{EN DASH}")
    return " ".join(n if n == "\N{EN DASH}" else f"{n} {unit}" for n in order) in page


def same(one: float | None, other: float | None) -> None:
    """Equal to the digits of limits.json; or both missing."""
    assert one == (other if other is None else pytest.approx(other, rel=1e-5))


def _the_sentence_is_what_the_files_say(result: Any, page: str, found: Any, limits: Any) -> None:
    head = headline(result)
    said = found["recommendation"]
    assert head.sentence in page and said["sentence"] == head.sentence
    assert limits["status"] == said["status"]
    same(limits["recommended"], said["stiffness"])
    if said["status"] == "untrusted":
        assert said["stiffness"] is None
    elif said["risk"] is not None:
        safe = found["critical_stiffness"]["safe"][f"{said['risk']:g}"]
        low, high = (found["critical_stiffness"][q] for q in ("q05", "q95"))
        shown = rounded_down(safe, result.analysis.limit.unit, low, high).text
        assert shown in head.sentence and len(re.findall(rf"{re.escape(shown)}\b", page)) >= 3
        assert said["stiffness"] <= safe
        assert safe == pytest.approx(said["stiffness"], rel=0.02)


def _what_is_stated_is_stated_everywhere(page: str, found: Any, limits: Any) -> None:
    for risk, stiffness in found["critical_stiffness"]["safe"].items():
        same(limits["stiffness"][risk], stiffness)
        for part in limits["boundaries"]:
            column = part["stiffness"][risk]
            if stiffness is None:
                assert column is None
            elif column is not None:
                assert column[0] == pytest.approx(stiffness, rel=1e-5)
    reason = found["critical_stiffness"]["reason"]
    assert ("None is stated" in page) is (reason is not None)
    if reason is not None:
        return
    unstated = None in found["critical_stiffness"]["safe"].values()
    assert ("too few draws to say" in page) >= unstated


def _the_limit_is_one(result: Any, page: str, found: Any) -> None:
    limit = found["critical_stiffness"]
    after = found["error"]["after"]["critical_stiffness"]
    if after["q50"] is not None:
        assert after == pytest.approx({q: limit[q] for q in after})
    stated = limit["reason"] is None
    if result.closed is not None and result.closed.effects and stated:  # type: ignore[union-attr]
        shown = estimate(limit["q50"], limit["q05"], limit["q95"], limit["unit"])
        assert shown in page  # the table of errors has the limit of the table of limits
    stages = result.analysis.seconds
    assert len(re.findall(r"draws in [\d.]+ m?s\b", page)) == 0
    assert all(page.count(f"{name} {spent:.1f} s") == 1 for name, spent in stages.items())


def _the_verdict_is_one(result: Any, page: str, found: Any) -> None:
    closed = result.closed
    fit = lights(result)[1]
    if misfit_is_clear(result.analysis) or residual_is_noticed(result.analysis):
        assert fit.state != "good" and "what pure noise would leave" not in page
        assert "What is left is noise" not in page and "explains the recording" not in page
    if closed is None:
        return
    for row in outcomes(closed):
        for said, threshold in zip(row[2::2], row[3::2], strict=True):
            number = said.replace(", beyond", "").replace("\N{MINUS SIGN}", "-").replace(",", "")
            if threshold != "\N{EN DASH}":
                assert said.endswith("beyond") == (float(number) > float(threshold))
    if closed.verdict == "unexplained":
        assert "explains the recording" not in page and "what pure noise would leave" not in page


def _doubtful_parameters_are_said_so(result: Any, page: str, found: Any) -> None:
    doubtful = doubtful_parameters(result)
    if not result.analysis.sampled:
        assert found["posterior"] is None and "Posterior" not in page.split("Methods")[0]
        return
    rows = found["posterior"]["parameters"]
    assert {name for name, row in rows.items() if not row["trusted"]} == set(doubtful)
    assert len(re.findall(r"not to be trusted\)", page)) == len(doubtful)
    followed = result.analysis.in_loop is not None
    unexplained = found["diagnosis"]["verdict"] == "unexplained" and not followed
    if unexplained or misfit_is_clear(result.analysis):
        assert set(doubtful) == set(rows)
    elif followed:
        assert set(doubtful) == (set(rows) if result.analysis.in_loop.doubts else set())
    if residual_is_noticed(result.analysis):
        assert doubtful


def _methods_are_those_of_this_run(result: Any, page: str, found: Any) -> None:
    said = methods(result)
    assert " ".join(said.split()) in page
    analysis = result.analysis
    followed, feedback = analysis.in_loop is not None, found["recording"]["feedback"]
    assert ("in closed loop" in said) == (followed and feedback)
    assert ("in open loop" in said) == (followed and not feedback)
    periodic = analysis.etfe.period_lines is not None
    assert ("excited lines" in said) == (periodic and analysis.in_loop is None)
    looked = analysis.sampled and not analysis.in_loop
    assert ("tests for effects" in said) == (result.closed is not None and looked)


def _the_index_says_no_more(found: Any, folder: Path) -> None:
    said = found["recommendation"]
    safe = row_of("x", folder, said["status"], None)["safe"]
    if said["stiffness"] is None or safe is None:
        assert said["status"] != "untrusted" or safe is None
    elif said["risk"] is None:
        assert safe == said["stiffness"]
    else:
        assert safe == found["critical_stiffness"]["safe"]["0.01"]


def _every_file_is_there(folder: Path) -> None:
    page = (folder / "report.html").read_text(encoding="utf-8")
    ids = set(re.findall(r' id="([^"]+)"', page))
    for link in set(re.findall(r'href="([^"]+)"', page)):
        if link.startswith("#"):
            assert link[1:] in ids, link
        elif not link.startswith("data:"):  # a picture inside of a figure
            assert (folder / link).exists() or link == "posterior.nc", link


def _effects_are_named_in_words(page: str) -> None:
    for effect in effects():
        if "_" in effect.name:
            assert effect.name not in page, effect.name
