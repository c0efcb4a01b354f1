"""Whether the residual is more than noise: one answer for the sentence, the sections, the JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.inference.least_squares import MISFIT
from bayeshaptic.report.numbers.quantities import pure

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

# The reduced chi-square of pure noise scatters by one over the root of the number of points.
_CHANCE_SDS = 4.0


def misfit_is_clear(analysis: Analysis) -> bool:
    """Whether the model lacks something: a residual far beyond the noise, and not by chance."""
    return not analysis.fit.reduced_chi_square <= max(MISFIT, _by_chance(analysis))


def misfit_is_faint(analysis: Analysis) -> bool:
    """Whether the residual is a little above the noise, but more than chance makes it."""
    above = analysis.fit.reduced_chi_square > _by_chance(analysis)
    return above and not misfit_is_clear(analysis)


def residual_is_noticed(analysis: Analysis) -> bool:
    """Whether a test found more than noise in the residual, and nobody traced it."""
    return any(notice.topic == "residual" for notice in analysis.notices)


def misfit_factor(analysis: Analysis) -> str:
    """How many times the noise the residual is, for a sentence."""
    return pure(math.sqrt(analysis.fit.reduced_chi_square), 2)


def _by_chance(analysis: Analysis) -> float:
    return 1.0 + _CHANCE_SDS / math.sqrt(max(len(analysis.fit.residual), 1))
