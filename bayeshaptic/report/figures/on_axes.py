"""Axes that a caller gives, or new ones, and legends that fit them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bayeshaptic.errors import InputError, shown
from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_NARROW_IN = 4.5  # axes less wide have no room for a legend or numbers beside them


def axes_of(ax: Axes | None, height_in: float, width_in: float = style.WIDTH_IN) -> Axes:
    """The axes that were given, or those of a new figure; an InputError where they are none."""
    if ax is not None:
        if not hasattr(ax, "transAxes"):
            raise InputError(f"ax is {shown(ax)}; this figure takes one Axes.")
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(width_in, height_in), layout="constrained")[1]


def is_narrow(axes: Axes) -> bool:
    """Whether there is no room beside what is drawn on these axes."""
    figure = axes.get_figure(root=True)
    return figure is not None and axes.get_position().width * figure.get_figwidth() < _NARROW_IN


def fit_legends(panels: Sequence[Axes]) -> None:
    """On narrow axes one legend below the lowest, in the place of those beside and inside them."""
    if not is_narrow(panels[-1]):
        return
    entries: dict[str, Any] = {}
    for axes in panels:
        legend = axes.get_legend()
        if legend is not None:
            shown = {text.get_text() for text in legend.get_texts()}
            known = zip(*axes.get_legend_handles_labels(), strict=True)
            entries.update({label: handle for handle, label in known if label in shown})
            legend.remove()
    if not entries:
        return
    from matplotlib.transforms import ScaledTranslation

    last, figure, gap_in = panels[-1], panels[-1].get_figure(root=True), 0.42
    assert figure is not None
    style.legend(
        last,
        handles=list(entries.values()),
        labels=list(entries),
        loc="upper center",
        bbox_to_anchor=(0.5, 0.0),
        bbox_transform=last.transAxes + ScaledTranslation(0, -gap_in, figure.dpi_scale_trans),
        ncols=2 if max(map(len, entries)) < 26 else 1,
        borderaxespad=0.0,
    )


def stacked(
    ax: Sequence[Axes] | None, heights: tuple[float, ...], counts: Sequence[int]
) -> Sequence[Axes]:
    """The axes that were given, or new ones below each other; an InputError for another number."""
    if ax is not None:
        given = len(ax) if hasattr(ax, "__len__") else 1
        if not hasattr(ax, "__len__") or given not in counts:
            allowed = " or ".join(str(count) for count in counts)
            raise InputError(
                f"ax has {given} axes; this figure takes {allowed}, as plt.subplots(2, 1)[1] has."
            )
        return ax
    import matplotlib.pyplot as plt

    options: dict[str, Any] = {"sharex": True, "height_ratios": heights, "layout": "constrained"}
    size = (style.WIDTH_IN, sum(heights))
    return list(plt.subplots(len(heights), 1, figsize=size, **options)[1])
