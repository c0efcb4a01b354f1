"""The report's figures, one at a time, on axes of your own: for notebooks and papers.

Each function draws on the axes that it is given, or on those of a new figure, and returns them::

    closed = bh.close_loop("lhifam-user.csv", device="lhifam")
    ax = bh.plot.limit(closed)
    ax.figure.savefig("limit.pdf")
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from bayeshaptic.stability.walls.limit_table import LimitTable

__all__ = [
    "before_after",
    "crossings",
    "estimates",
    "limit",
    "marginals",
    "pairs",
    "residual",
    "response",
    "walls",
]

_WIDTH_IN = 7.4


def limit(result: Result, ax: Axes | None = None) -> Axes:
    """The distribution of the critical stiffness by binding crossing, with the risks.

    Parameters
    ----------
    result : Analysis or Closed
    ax : Axes, optional
        By default those of a new figure.

    Returns
    -------
    Axes
    """
    from bayeshaptic.report.figures import stiffness

    axes = _axes(ax, 3.3)
    stiffness.draw_on(axes, result)
    return axes


def estimates(result: Result, ax: Axes | None = None) -> Axes:
    """Every estimate of the limit on one axis: model, deterministic fit, measurement, rules.

    Parameters
    ----------
    result : Analysis or Closed
    ax : Axes, optional
        By default those of a new figure.

    Returns
    -------
    Axes
    """
    from bayeshaptic.report.figures import answer

    axes = _axes(ax, 2.4)
    answer.draw_on(axes, result)
    return axes


def before_after(closed: Closed, ax: Axes | None = None) -> Axes:
    """The critical stiffness before and after closing the loop, beside the measurement's own.

    Parameters
    ----------
    closed : Closed
    ax : Axes, optional
        By default those of a new figure.

    Returns
    -------
    Axes
    """
    from bayeshaptic.report.figures.loop import stiffness

    axes = _axes(ax, 2.0)
    stiffness.draw_on(axes, closed)
    return axes


def walls(result: Result, ax: Axes | None = None, table: LimitTable | None = None) -> Axes:
    """The probability that a wall is stable, over its damping and stiffness.

    Parameters
    ----------
    result : Analysis or Closed
    ax : Axes, optional
        By default those of a new figure.
    table : LimitTable, optional
        What `bayeshaptic.limit_table` said of it, which takes seconds; its first filter is drawn.

    Returns
    -------
    Axes
    """
    from bayeshaptic.report.figures import style
    from bayeshaptic.report.figures.walls import kb
    from bayeshaptic.report.walls.section import case_of, table_of

    known = table_of([case_of(result)]) if table is None else table
    axes = _axes(ax, 3.5)
    kb.draw_on(axes, known.filters[0], known)
    if axes.get_legend_handles_labels()[0]:  # no boundary where the draws are too few for one
        style.legend(axes)
    return axes


def response(result: Result, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """The measured frequency response with the model's band: gain and phase.

    Parameters
    ----------
    result : Analysis or Closed
    ax : sequence of Axes, optional
        Two for gain and phase, a third for their ratio, a fourth for the coherence; by default
        two of a new figure.

    Returns
    -------
    sequence of Axes
    """
    from bayeshaptic.report.figures import response as figure

    panels = _several(ax, (2.8, 2.0), range(2, len(figure.heights_of(result)) + 1))
    figure.draw_on(panels, result)
    return panels


def crossings(result: Result, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """Where the limit comes from: 1/|G| and the phase, with every crossing.

    Parameters
    ----------
    result : Analysis or Closed
    ax : sequence of Axes, optional
        Two; by default those of a new figure.

    Returns
    -------
    sequence of Axes
    """
    from bayeshaptic.report.figures import crossings as figure

    panels = _several(ax, (2.6, 1.8), (2,))
    figure.draw_on(panels, result)
    return panels


def residual(result: Result, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
    """What the model leaves over, in units of the noise, by line and in third octaves.

    Parameters
    ----------
    result : Analysis or Closed
    ax : sequence of Axes, optional
        Two; by default those of a new figure.

    Returns
    -------
    sequence of Axes
    """
    from bayeshaptic.report.figures import residuals

    panels = _several(ax, (2.5, 1.7), (2,))
    residuals.draw_on(panels, result)
    return panels


def marginals(result: Result, name: str, ax: Axes | None = None) -> Axes:
    """Posterior and prior of one parameter, with the deterministic fit.

    Parameters
    ----------
    result : Analysis or Closed
    name : str
        Of the parameter.
    ax : Axes, optional
        By default those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the model has no such parameter.
    """
    from bayeshaptic.report.figures import marginals as figure

    _known(result, name)
    axes = _axes(ax, 2.4, 3.6)
    figure.draw_on(axes, result, name)
    return axes


def pairs(result: Result, x: str, y: str, ax: Axes | None = None) -> Axes:
    """Draws of two parameters, with contours that hold 50 % and 90 % of them.

    Parameters
    ----------
    result : Analysis or Closed
    x, y : str
        Names of the parameters.
    ax : Axes, optional
        By default those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If the model has no such parameter.
    """
    from bayeshaptic.report.figures import pairs as figure

    _known(result, x, y)
    axes = _axes(ax, 3.6, 3.6)
    figure.draw_on(axes, result, x, y)
    return axes


def _known(result: Result, *names: str) -> None:
    model = result.analysis.model
    for name in names:
        if name not in model.names:
            raise InputError(f"no parameter {name!r}; the model has {', '.join(model.names)}.")


def _axes(ax: Axes | None, height_in: float, width_in: float = _WIDTH_IN) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(width_in, height_in), layout="constrained")[1]


def _several(
    ax: Sequence[Axes] | None, heights: tuple[float, ...], counts: Sequence[int]
) -> Sequence[Axes]:
    if ax is not None:
        if len(ax) not in counts:
            allowed = " or ".join(str(count) for count in counts)
            raise InputError(f"ax has {len(ax)} axes; this figure takes {allowed}.")
        return ax
    import matplotlib.pyplot as plt

    options: dict[str, Any] = {"sharex": True, "height_ratios": heights, "layout": "constrained"}
    size = (_WIDTH_IN, sum(heights))
    return list(plt.subplots(len(heights), 1, figsize=size, **options)[1])
