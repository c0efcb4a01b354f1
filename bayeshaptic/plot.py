"""The report's figures, one at a time, on axes of your own: for notebooks and papers.

Each function draws on the axes that it is given, or on those of a new figure, and returns them::

    closed = bh.close_loop("lhifam-user.csv", device="lhifam")
    ax = bh.plot.limit(closed)
    ax.figure.savefig("limit.pdf")

On narrow axes, as in a column of a journal, legends stand below and numbers under their names.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from bayeshaptic.arguments import at_the_door
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.errors import InputError
from bayeshaptic.report.figures import (
    answer,
    crossings as crossings_figure,
    marginals as marginals_figure,
    pairs as pairs_figure,
    residuals as residuals_figure,
    response as response_figure,
    stiffness,
    style,
)
from bayeshaptic.report.figures.loop import stiffness as loop_stiffness
from bayeshaptic.report.figures.on_axes import axes_of, fit_legends, is_narrow, stacked
from bayeshaptic.report.figures.walls import kb
from bayeshaptic.report.walls.section import case_of, table_of

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


class OnePanel(Protocol):
    """A figure of one panel."""

    def __call__(self, result: Result, ax: Axes | None = None) -> Axes:
        """Draw it."""


class SeveralPanels(Protocol):
    """A figure of several panels."""

    def __call__(self, result: Result, ax: Sequence[Axes] | None = None) -> Sequence[Axes]:
        """Draw it."""


def _one(
    name: str,
    what: str,
    draw_on: Callable[[Axes, Any], None],
    height_in: float,
    of_a_loop: bool = False,
) -> OnePanel:
    """The public function of a figure of one panel."""

    @at_the_door
    def drawn(result: Result, ax: Any = None) -> Axes:
        if of_a_loop and result.closed is None:
            raise InputError(
                "result is an analysis without a closed loop; give what bayeshaptic.close_loop "
                "returned."
            )
        axes = axes_of(ax, height_in)
        draw_on(axes, result)
        fit_legends((axes,))
        return axes

    return _named(drawn, name, what, "ax : Axes, optional\n    By default those of a new figure.")


def _several(
    name: str,
    what: str,
    draw_on: Callable[[Sequence[Axes], Any], None],
    heights_in: tuple[float, ...],
    panels: str = "Two",
    most: Callable[[Any], int] = lambda result: 2,
) -> SeveralPanels:
    """The public function of a figure of two panels or more."""

    @at_the_door
    def drawn(result: Result, ax: Any = None) -> Sequence[Axes]:
        given = stacked(ax, heights_in, range(2, most(result) + 1))
        draw_on(given, result)
        fit_legends(given)
        return given

    return _named(
        drawn, name, what, f"ax : sequence of Axes, optional\n    {panels}; by default new ones."
    )


def _named(function: Any, name: str, what: str, ax: str) -> Any:
    function.__name__ = function.__qualname__ = name
    kind = "sequence of Axes" if "sequence" in ax else "Axes"
    function.__doc__ = (
        f"{what}\n\nParameters\n----------\nresult : Analysis or Closed\n{ax}\n\n"
        f"Returns\n-------\n{kind}\n"
    )
    return function


limit = _one(
    "limit",
    "The distribution of the critical stiffness by binding crossing, with the risks.",
    stiffness.draw_on,
    3.3,
)
estimates = _one(
    "estimates",
    "Every estimate of the limit on one axis: model, deterministic fit, measurement, rules.",
    lambda axes, result: answer.draw_on(axes, result, is_narrow(axes)),
    2.4,
)
before_after = _one(
    "before_after",
    "The critical stiffness before and after closing the loop, beside the measurement's own.",
    lambda axes, result: loop_stiffness.draw_on(axes, result, is_narrow(axes)),
    2.0,
    of_a_loop=True,
)
response = _several(
    "response",
    "The measured frequency response with the model's band: gain and phase.",
    response_figure.draw_on,
    (2.8, 2.0),
    "Two for gain and phase, a third for their ratio, a fourth for the coherence",
    lambda result: len(response_figure.heights_of(result)),
)
crossings = _several(
    "crossings",
    "Where the limit comes from: 1/abs(G) and the phase, with every crossing.",
    crossings_figure.draw_on,
    (2.6, 1.8),
)
residual = _several(
    "residual",
    "What the model leaves over, in units of the noise, by line and in third octaves.",
    residuals_figure.draw_on,
    (2.5, 1.7),
)


@at_the_door
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
    known = table_of([case_of(result)]) if table is None else table
    axes = axes_of(ax, 3.5)
    kb.draw_on(axes, known.filters[0], known)
    if axes.get_legend_handles_labels()[0]:  # no boundary where the draws are too few for one
        style.legend(axes)
    fit_legends((axes,))
    return axes


@at_the_door
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
    _known(result, name)
    axes = axes_of(ax, 2.4, 3.6)
    marginals_figure.draw_on(axes, result, name)
    style.legend(axes)
    fit_legends((axes,))
    return axes


@at_the_door
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
    _known(result, x, y)
    axes = axes_of(ax, 3.6, 3.6)
    pairs_figure.draw_on(axes, result, x, y)
    return axes


def _known(result: Result, *names: str) -> None:
    model = result.analysis.model
    for name in names:
        if name not in model.names:
            raise InputError(f"no parameter {name!r}; the model has {', '.join(model.names)}.")
