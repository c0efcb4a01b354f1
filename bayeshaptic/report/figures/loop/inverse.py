"""Inverse dynamics: the force that the motion does not explain, and the error term by term."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from bayeshaptic.quantities import scale
from bayeshaptic.report.figures import style
from bayeshaptic.report.loop.force_words import fits, titles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.diagnosis.feedback.explain import ForceExplained


def draw(closed: Closed) -> Figure:
    """Residual force over velocity on the left, held-out error on the right."""
    assert closed.force is not None
    etfe = closed.base.etfe
    figure = style.new_figure(3.0)
    left, right = figure.subplots(1, 2, width_ratios=(1.3, 1.0))
    _residual(left, closed.force, etfe.force_unit, etfe.position_unit)
    _errors(right, closed.force, etfe.force_unit)
    return figure


def _residual(axes: Axes, force: ForceExplained, force_unit: str, position_unit: str) -> None:
    first = force.first
    path = first.path
    mass, damping, constant = (first[term.name][0] for term in first.terms[:3])
    linear = mass * path.acceleration + damping * path.velocity + constant
    row = scale(max(step.held_out_rms for step in force.further.steps), force_unit)
    most_dots = 3000
    every = max(len(path.velocity) // most_dots, 1)
    left = {"mass, damper and constant force": first.force - linear}
    left |= {name: found.force - found.explained for name, found in fits(force).items()}
    looks = [(style.OTHER, "s"), (style.CYCLE[1], "^"), (style.MODEL, "o")]
    if len(left) < len(looks):
        del looks[1]
    for (name, rest), (colour, marker) in zip(left.items(), looks, strict=False):
        axes.plot(
            path.velocity[::every],
            row.factor * rest[::every],
            marker,
            color=colour,
            markersize=1.4,
            label=name,
            rasterized=True,
        )
    style.panel(axes, f"velocity, {position_unit}/s", f"force not explained, {row.unit}")
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.35 * (high - low))
    style.legend(axes, loc="upper left", markerscale=4)


def _errors(axes: Axes, force: ForceExplained, unit: str) -> None:
    steps = force.further.steps
    row = scale(max(step.held_out_rms for step in steps), unit)
    errors = [row.factor * step.held_out_rms for step in steps]
    known = titles(force.further)
    names = ["mass, damper, constant", *(known[step.term] for step in steps[1:])]
    bars = axes.barh(range(len(steps)), errors, color=style.MODEL, height=0.6)
    axes.bar_label(bars, fmt="%.3g", fontsize=style.SMALL, padding=2)
    style.rows(axes, [textwrap.fill(name, 22) for name in names])
    axes.set_xlim(0, 1.15 * max(errors))
    style.panel(axes, f"error on the other half, {row.unit} rms", grid=False)
