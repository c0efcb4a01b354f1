"""Every test of the residual before and after closing the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.report.figures import style
from bayeshaptic.report.numbers.titles import question

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.closed import Closed


def _first(closed: Closed) -> str:
    return "before" if closed.effects else "model as declared"


def draw(closed: Closed) -> Figure:
    """A row a test: its statistic over its threshold, on a logarithmic axis."""
    before = closed.traced.before
    after = {test.name: test for test in closed.traced.after} if closed.effects else {}
    figure = style.new_figure(0.9 + 0.2 * len(before))
    axes = style.panel(figure.subplots(), "statistic / threshold (beyond 1: more than noise gives)")
    axes.grid(False, axis="y")
    least = 0.05
    excess = [max(test.excess, least) for test in (*before, *after.values())]
    high = max(2.0, 1.4 * max(excess))
    axes.axvspan(1.0, high, color="#f3e3da", linewidth=0, zorder=0)
    axes.axvline(1.0, color=style.DATA, linewidth=0.8)
    for place, test in enumerate(before):
        old = max(test.excess, least)
        now = after.get(test.name)
        if now is not None:
            new = max(now.excess, least)
            axes.plot([old, new], [place, place], color=style.PRIOR, linewidth=0.8, zorder=2)
            axes.plot([new], [place], "o", color=style.MODEL, markersize=5, zorder=4)
        axes.plot(
            [old], [place], "s", color=style.OTHER, markersize=5, markerfacecolor="white", zorder=3
        )
    axes.plot([], [], "s", color=style.OTHER, markerfacecolor="white", label=_first(closed))
    if after:
        axes.plot([], [], "o", color=style.MODEL, label="after, with what was added")
    room = 1e4  # times, from which on numbers between the powers of ten would overlap
    style.log_scale(axes.xaxis, (1, 2, 5) if high < room * least else (1,))
    axes.set_xlim(0.9 * least, high)
    style.rows(axes, [question(test) for test in before])
    style.legend(axes, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.1)
    return figure
