"""The figures of a report, one module each with ``draw(result) -> Figure``.

To add one, write the module and add a line to PICTURES; to LOOP_PICTURES, with
``draw(closed) -> Figure``, where it shows what closing the loop found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures import (
    answer,
    crossings,
    marginals,
    pairs,
    record,
    residuals,
    response,
    sampler,
    stiffness,
)
from bayeshaptic.report.figures.loop import (
    force as loop_force,
    inverse as loop_inverse,
    residual as loop_residual,
    stiffness as loop_stiffness,
    tests as loop_tests,
)
from bayeshaptic.report.figures.style import Drawn, drawn
from bayeshaptic.report.numbers.unstated import unstated

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Picture:
    """A figure of a report: its file's name, how to draw it, what it shows in words, and when."""

    name: str
    draw: Callable[[Any], Figure]
    alternative: str
    shown: Callable[[Any], bool] = lambda result: True


def _has_limit(result: Result) -> bool:
    return unstated(result.analysis) is None


def _is_sampled(result: Result) -> bool:
    return result.analysis.sampled


PICTURES = (
    Picture(
        "answer",
        answer.draw,
        "Model, deterministic fit, measurement and rules: each one's limit with its 90 % interval",
        shown=_has_limit,
    ),
    Picture(
        "answer_narrow",
        answer.draw_narrow,
        "The same estimates of the limit, for a narrow screen",
        shown=_has_limit,
    ),
    Picture(
        "stiffness",
        stiffness.draw,
        "Distribution of the critical stiffness by crossing",
        shown=_has_limit,
    ),
    Picture("response", response.draw, "Measured gain, phase and coherence with the model's band"),
    Picture(
        "record",
        record.draw,
        "Force and position over time, their spectra, and how often each value occurs",
        shown=record.is_shown,
    ),
    Picture(
        "residuals",
        residuals.draw,
        "Residual over frequency in units of the noise",
        shown=_is_sampled,
    ),
    Picture(
        "crossings",
        crossings.draw,
        "Stiffness and phase over frequency, with every crossing",
        shown=_has_limit,
    ),
    Picture(
        "marginals",
        marginals.draw,
        "Posterior, prior and least squares of each parameter",
        shown=_is_sampled,
    ),
    Picture(
        "pairs",
        pairs.draw,
        "Pairs of the most strongly correlated parameters",
        shown=_is_sampled,
    ),
    Picture(
        "sampler",
        sampler.draw,
        "Trace, ranks, effective draws and R-hat of the sampler",
        shown=_is_sampled,
    ),
)


LOOP_PICTURES = (
    Picture(
        "loop_residual",
        loop_residual.draw,
        "Residual over frequency before and after",
        shown=lambda closed: closed.verdict != "consistent" and not closed.analysis.etfe.direct,
    ),
    Picture("loop_tests", loop_tests.draw, "Every test of the residual before and after"),
    Picture(
        "loop_force",
        loop_force.draw,
        "Residual force over the motion before and after",
        shown=loop_force.is_shown,
    ),
    Picture(
        "loop_stiffness",
        loop_stiffness.draw,
        "Critical stiffness before and after, and the measurement's own",
        shown=lambda closed: closed.verdict != "consistent" and _has_limit(closed),
    ),
)


FORCE_PICTURES = (
    Picture(
        "loop_inverse",
        loop_inverse.draw,
        "Force that the motion does not explain, and the error term by term",
    ),
)


def draw_pictures(result: Result) -> dict[str, Drawn]:
    """Every figure of an analysis, or of a closed loop, by name."""
    chosen, closed = list(PICTURES), result.closed
    if closed is not None and closed.force is not None:
        chosen += FORCE_PICTURES
    elif closed is not None and result.analysis.sampled:
        chosen += LOOP_PICTURES
    return all_drawn(chosen, result)


def all_drawn(pictures: Iterable[Picture], result: Any) -> dict[str, Drawn]:
    """Those of the `pictures` that the result has, by name."""
    return {p.name: drawn(p.draw(result), p.name) for p in pictures if p.shown(result)}
