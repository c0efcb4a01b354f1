"""What could hide: a row an effect, how far it could move the limit without having been seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import percent
from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.hidden import size

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.hidden.hidden import Hidden, HiddenEffect

SHOWN = 10


def draw(hidden: Hidden) -> Figure:
    """A bar an effect, in dB of K_CR; behind them the interval of the declared model."""
    shown = hidden.effects[:SHOWN]
    figure = style.new_figure(0.85 + 0.26 * max(len(shown), 1))
    axes = style.panel(figure.subplots(), "change of the critical stiffness, dB")
    axes.grid(False, axis="y")
    axes.locator_params(axis="x", nbins=5)  # small changes have long numbers
    _declared(axes, hidden)
    for place, effect in enumerate(shown):
        low, middle, high = effect.shift_db
        axes.plot([low, high], [place, place], color=style.OTHER, linewidth=3.0, alpha=0.8)
        axes.plot([middle], [place], "o", color=style.OTHER, markersize=4.5)
    style.rows(axes, [effect.title for effect in shown], [_label(effect) for effect in shown])
    return figure


def _declared(axes: Axes, hidden: Hidden) -> None:
    """The declared model's 90 % interval around its median."""
    ends = hidden.declared.db([0.05, 0.5, 0.95])
    if np.isfinite(ends).all():
        axes.axvspan(ends[0] - ends[1], ends[2] - ends[1], color=style.GRID, zorder=0)
    axes.axvline(0, color=style.DATA, linewidth=0.7)


def _label(effect: HiddenEffect) -> str:
    return f"{percent(effect.probability)} likely, {size(effect)}"
