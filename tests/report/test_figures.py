"""The figures of a report: what they compute, and that their texts can be read."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_analysis import CASES, fake_analysis, fake_closed

from bayeshaptic.quantities import scale
from bayeshaptic.report.figures import marginals, pairs, residuals, stiffness
from bayeshaptic.report.figures.drawing.look import own_look
from bayeshaptic.report.figures.loop import tests as loop_tests
from bayeshaptic.report.figures.pairs import correlation, strongest
from bayeshaptic.report.figures.pictures import PICTURES
from bayeshaptic.report.figures.sampler import rank_histogram
from bayeshaptic.report.figures.style import drawn
from bayeshaptic.report.numbers.octaves import third_octaves
from bayeshaptic.report.tables import parameters


def test_third_octaves_hold_pure_noise() -> None:
    rng = np.random.default_rng(1)
    frequency = np.geomspace(1.0, 300.0, 20_000)
    residual = (rng.normal(size=20_000) + 1j * rng.normal(size=20_000)) / np.sqrt(2)
    bands = third_octaves(frequency, residual)
    outside = np.mean((bands.rms < bands.low) | (bands.rms > bands.high))
    assert len(bands.rms) == 25
    assert outside <= 2 / 25  # 1 % expected
    assert np.all(np.diff(bands.frequency_hz) > 0)
    doubled = third_octaves(frequency, 2 * residual)
    np.testing.assert_allclose(doubled.rms, 2 * bands.rms)


def test_ranks_are_flat_for_ensembles_of_one_density_only() -> None:
    rng = np.random.default_rng(2)
    chains = rng.normal(size=(4, 500, 32))
    flat = rank_histogram(chains)
    np.testing.assert_allclose(flat.mean(axis=1), 1.0)
    assert np.abs(flat - 1).max() < 5 * np.sqrt(20 / 16_000)  # 5 sd of a share of 1/20
    chains[0] += 1.0
    assert rank_histogram(chains)[0, -1] > 1.5


def test_the_strongest_pairs_are_shown() -> None:
    rng = np.random.default_rng(3)
    draws = rng.normal(size=(4000, 9))
    draws[:, 7] = draws[:, 2] + 0.1 * rng.normal(size=4000)
    draws[:, 4] = np.exp(-draws[:, 8]) * (1 + 0.01 * rng.normal(size=4000))
    matrix = correlation(draws)
    assert matrix[2, 7] > 0.98 and matrix[4, 8] < -0.98
    assert strongest(matrix, 4) == [2, 4, 7, 8]
    assert strongest(correlation(draws[:, :2])) == [0, 1]


@pytest.fixture
def drawn_texts(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[Any]]:
    """Place and words of every text that matplotlib draws, as it is drawn."""
    from matplotlib.text import Text

    drawn: list[Any] = []
    original = Text.draw

    def draw(self: Any, renderer: Any, *rest: Any, **named: Any) -> Any:
        if self.get_visible() and self.get_text().strip():
            drawn.append((self.get_window_extent(), self.get_text()))
        return original(self, renderer, *rest, **named)

    monkeypatch.setattr(Text, "draw", draw)
    yield drawn


@pytest.mark.parametrize("case", ["grasped", "wide", "amperes", "table", "narrow"])
def test_no_text_of_a_figure_covers_another_or_is_cut_off(
    case: str, drawn_texts: list[Any]
) -> None:
    analysis = fake_analysis(**CASES[case])
    for picture in (picture for picture in PICTURES if picture.shown(analysis)):
        figure = picture.draw(analysis)
        drawn_texts.clear()
        figure.canvas.draw()
        boxes = list(drawn_texts)
        assert sum(1 + text.count("\n") for _, text in boxes) > 10, picture.name
        canvas = figure.bbox
        for box, text in boxes:
            inside = (
                box.x0 > canvas.x0 - 1
                and box.y0 > canvas.y0 - 1
                and box.x1 < canvas.x1 + 1
                and box.y1 < canvas.y1 + 1
            )
            assert inside, (picture.name, text)
        assert not covered(boxes), picture.name


def covered(boxes: list[Any]) -> list[tuple[str, str]]:
    """Pairs of texts of which one covers the other."""
    found = []
    for index, (box, text) in enumerate(boxes):
        for other, words in boxes[index + 1 :]:
            wide = min(box.x1, other.x1) - max(box.x0, other.x0)
            high = min(box.y1, other.y1) - max(box.y0, other.y0)
            if wide >= 1.5 and high >= 1.5:
                found.append((text, words))
    return found


@pytest.mark.parametrize("size", [8.0, 60.0, 4000.0])
def test_numbers_of_a_residual_over_decades_have_room(size: float, drawn_texts: list[Any]) -> None:
    analysis = fake_analysis()
    slope = np.geomspace(1.0, size, len(analysis.fit.residual))  # noise at one end of the band
    analysis.fit = replace(analysis.fit, residual=analysis.fit.residual * slope)
    figure = residuals.draw(analysis)
    drawn_texts.clear()
    figure.canvas.draw()
    assert not covered(drawn_texts)


@pytest.mark.parametrize("size", [30.0, 9e2, 3e4])
def test_numbers_of_tests_far_beyond_have_room(size: float, drawn_texts: list[Any]) -> None:
    closed = fake_closed("unexplained", "linear")
    first, *others = closed.traced.before
    before = (replace(first, statistic=size * first.threshold), *others)
    figure = loop_tests.draw(replace(closed, traced=replace(closed.traced, before=before)))
    drawn_texts.clear()
    figure.canvas.draw()
    assert not covered(drawn_texts)


def test_a_parameter_that_may_be_zero_has_one_unit_in_table_and_figures() -> None:
    analysis = fake_analysis("free", "phantom")
    place = analysis.model.names.index("b2")
    draws = np.array(analysis.stated.draws)
    ranks = np.argsort(np.argsort(draws[:, place - 1]))  # a pair that is shown
    draws[:, place] = np.geomspace(1e-9, 1e-3, len(draws))[ranks]  # median 1e-6, 95 % end 5e-4
    analysis.posterior = replace(analysis.posterior, chains=draws[None, :, None])
    unit = {row.name: row.unit for row in parameters(analysis)}["b2"]
    assert unit != scale(1e-6, "Nm s/rad").unit  # as it would be by the median
    panels = [axes.get_title(loc="left") for axes in marginals.draw(analysis).axes]
    assert f"b2 [{unit}]" in panels
    assert f"b2\n[{unit}]" in {axes.get_ylabel() for axes in pairs.draw(analysis).axes}


def test_no_correlation_is_less_than_nothing() -> None:
    analysis = fake_analysis("rigid")
    draws = np.array(analysis.stated.draws)
    rng = np.random.default_rng(4)
    while not -0.004 < pairs.correlation(draws)[0, 1] < 0.0:
        draws[:, 0] = rng.permutation(draws[:, 0])
    analysis.posterior = replace(analysis.posterior, chains=draws[None, :, None])
    axes = pairs.draw(analysis).axes[0]
    assert axes.texts[0].get_text() == "+0.00"


def test_decibels_of_a_limit_over_a_decade_have_room(drawn_texts: list[Any]) -> None:
    analysis = fake_analysis("rigid")
    samples = np.linspace(37.0, 275.0, len(analysis.limit.samples))
    analysis.limit = replace(analysis.limit, samples=samples)
    figure = stiffness.draw(analysis)
    drawn_texts.clear()
    figure.canvas.draw()
    (top,) = figure.axes[0].child_axes
    names = {text.get_text() for text in top.get_xticklabels()}
    ends = sorted((box.x0, box.x1) for box, text in drawn_texts if text in names)
    above = [pair for pair in ends if pair]
    assert {"30", "40", "45"} <= names and len(above) >= 4
    assert all(left[1] < right[0] for left, right in zip(above, above[1:], strict=False))


def test_long_numbers_below_a_marginal_have_room(drawn_texts: list[Any]) -> None:
    analysis = fake_analysis("grasped")
    draws = np.array(analysis.stated.draws)
    draws[:, 0] = np.linspace(0.18992, 0.19008, len(draws))  # known to 0.02 %
    analysis.posterior = replace(analysis.posterior, chains=draws[None, :, None])
    figure = marginals.draw(analysis)
    drawn_texts.clear()
    figure.canvas.draw()
    long = [(box.x0, box.x1) for box, text in drawn_texts if text.startswith(("0.189", "0.190"))]
    boxes = sorted(long)
    assert len(boxes) >= 2
    assert all(left[1] + 3 < right[0] for left, right in zip(boxes, boxes[1:], strict=False))


def test_figures_are_the_same_in_threads_and_need_no_display() -> None:
    analysis = fake_analysis("rigid")
    few = [picture for picture in PICTURES if picture.name in ("stiffness", "response", "pairs")]
    alone = [drawn(picture.draw(analysis), picture.name) for picture in few]
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(lambda p: drawn(p.draw(analysis), p.name), 2 * few))
    assert alone + alone == together
    assert all(picture.png.startswith(b"\x89PNG") for picture in alone)


def test_what_a_user_set_for_figures_of_their_own_stays_outside() -> None:
    import matplotlib

    def answer() -> bytes:
        with own_look():
            return drawn(PICTURES[0].draw(fake_analysis()), "answer").png

    usual = answer()
    mine = {"text.usetex": True, "axes.facecolor": "black", "font.size": 30.0, "savefig.dpi": 20.0}
    with matplotlib.rc_context(mine):
        assert answer() == usual
        with own_look():
            with own_look():
                pass
            assert not matplotlib.rcParams["text.usetex"]  # another thread still draws
        assert all(matplotlib.rcParams[name] == value for name, value in mine.items())


def test_a_sign_without_a_font_is_no_warning_and_warnings_stay_as_they_are() -> None:
    from bayeshaptic.report.figures.style import new_figure, panel

    before = list(warnings.filters)
    with own_look():
        figure = new_figure(1.0)
        panel(figure.add_subplot(), title="user 日本")
        assert "user 日本" in (drawn(figure, "a").svg or "")
    assert list(warnings.filters) == before


def test_dollars_in_names_are_no_formula() -> None:
    from bayeshaptic.report.figures.style import new_figure, panel

    with own_look():
        figure = new_figure(1.0)
        panel(figure.add_subplot(), title="user$_{o$")
        assert "user$_{o$" in (drawn(figure, "a").svg or "")
