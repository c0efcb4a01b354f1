"""The report's figures on axes of one's own."""

from __future__ import annotations

import inspect
from functools import cache
from typing import Any

import pytest
from fake_analysis import fake_analysis, fake_closed
from matplotlib.figure import Figure

import bayeshaptic as bh
from bayeshaptic.report.walls.section import case_of, table_of


@cache
def result() -> Any:
    return fake_closed()


@pytest.mark.parametrize("name", ["limit", "estimates", "before_after"])
def test_one_panel_is_drawn_where_it_is_wanted(name: str) -> None:
    axes = Figure().subplots()
    assert getattr(bh.plot, name)(result(), ax=axes) is axes
    assert axes.get_xlabel().startswith("critical stiffness") and axes.has_data()


@pytest.mark.parametrize("name", ["response", "crossings", "residual"])
def test_two_panels_are_drawn_where_they_are_wanted(name: str) -> None:
    axes = list(Figure().subplots(2, 1))
    assert getattr(bh.plot, name)(result(), ax=axes) is axes
    assert all(one.has_data() for one in axes)
    with pytest.raises(bh.InputError, match="ax has 1 axes; this figure takes 2"):
        getattr(bh.plot, name)(result(), ax=axes[:1])


@pytest.mark.parametrize("name", bh.plot.__all__)
def test_what_cannot_be_drawn_is_said(name: str) -> None:
    draw, several = getattr(bh.plot, name), name in ("response", "crossings", "residual")
    names = {"marginals": ("kc",), "pairs": ("m1", "kc")}.get(name, ())
    with pytest.raises(bh.InputError, match="result is of type Fit; give what bayeshaptic.ana"):
        draw(result().analysis.fit, *names)
    axes = Figure().subplots(1, 2)
    with pytest.raises(bh.InputError, match="ax has 1 axes; .* 2" if several else "takes one Axes"):
        draw(result(), *names, ax=axes[0] if several else axes)


def test_before_and_after_need_a_closed_loop() -> None:
    with pytest.raises(bh.InputError, match="give what bayeshaptic.close_loop returned"):
        bh.plot.before_after(fake_analysis())


def test_parameters_are_drawn_by_name() -> None:
    left, right = Figure().subplots(1, 2)
    assert bh.plot.marginals(result(), "kc", ax=left) is left and left.has_data()
    assert bh.plot.pairs(result(), "m1", "kc", ax=right) is right
    assert right.get_xlabel().startswith("m1 [") and right.get_ylabel().startswith("kc [")
    with pytest.raises(bh.InputError, match="no parameter 'mass'; the model has m1"):
        bh.plot.marginals(result(), "mass", ax=left)


@pytest.mark.parametrize("name", ["limit", "response", "crossings", "residual"])
def test_in_a_column_the_legend_stands_below_and_takes_no_width(name: str) -> None:
    figure = Figure(figsize=(3.5, 4.5), layout="constrained")
    count = 1 if name == "limit" else 2
    panels = list(figure.subplots(count, 1, squeeze=False).ravel())
    getattr(bh.plot, name)(result(), ax=panels[0] if count == 1 else panels)
    figure.draw_without_rendering()
    legend = panels[-1].get_legend()
    assert legend.get_window_extent().y1 < panels[-1].get_window_extent().y0
    assert panels[-1].get_position().width > 0.7
    assert [axes.get_legend() for axes in panels[:-1]] == [None] * (count - 1)


def test_walls_take_a_table_that_is_there() -> None:
    analysis = fake_analysis("rigid")
    axes = Figure().subplots()
    table = table_of([case_of(analysis)], draws=60)
    assert bh.plot.walls(analysis, ax=axes, table=table) is axes and axes.has_data()


def test_without_axes_there_is_a_new_figure() -> None:
    import matplotlib.pyplot as plt

    axes = bh.plot.limit(fake_analysis("rigid"))
    assert axes.figure.get_size_inches()[0] == pytest.approx(7.4)
    plt.close(axes.figure)


def test_every_argument_is_documented() -> None:
    for name in bh.plot.__all__:
        function = getattr(bh.plot, name)
        for argument in inspect.signature(function).parameters:
            assert argument in (function.__doc__ or ""), (name, argument)


def test_a_large_group_has_a_label_that_fits() -> None:
    from bayeshaptic.report.figures.guidance.shares import labels
    from bayeshaptic.stability.guidance.shares import Share, VarianceShares

    many = Share(("m1", "b1", "bc", "kc", "m2", "b2", "bs", "ks"), 0.8, 0.9)
    few = Share(("m1", "b1", "bc", "kc", "m2"), 0.2, 0.9)
    found = labels(VarianceShares((many, few), 0.1, 0.0, 100))
    assert [name for name, _ in found] == ["m1, b1, bc, kc and 4 more", "m1, b1, bc, kc, m2"]
