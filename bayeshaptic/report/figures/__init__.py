"""The figures of a report, one module each with ``draw(analysis) -> Figure``.

To add one, write the module and add a line to PICTURES.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.report.figures import (
    crossings,
    marginals,
    pairs,
    residuals,
    response,
    sampler,
    stiffness,
)
from bayeshaptic.report.figures.style import png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.analysis import Analysis

__all__ = ["PICTURES", "Picture", "draw_pictures", "png"]


@dataclass(frozen=True)
class Picture:
    """A figure of the report: the name of its file, how to draw it, and what it shows in words."""

    name: str
    draw: Callable[[Analysis], Figure]
    alternative: str


PICTURES = (
    Picture("stiffness", stiffness.draw, "Distribution of the critical stiffness by crossing"),
    Picture("response", response.draw, "Measured gain, phase and coherence with the model's band"),
    Picture("residuals", residuals.draw, "Residual over frequency in units of the noise"),
    Picture("crossings", crossings.draw, "Stiffness and phase over frequency, with every crossing"),
    Picture("marginals", marginals.draw, "Posterior, prior and least squares of each parameter"),
    Picture("pairs", pairs.draw, "Pairs of the most strongly correlated parameters"),
    Picture("sampler", sampler.draw, "Trace, ranks, effective draws and R-hat of the sampler"),
)


def draw_pictures(analysis: Analysis) -> dict[str, bytes]:
    """Every figure as PNG, by name."""
    return {picture.name: png(picture.draw(analysis)) for picture in PICTURES}
