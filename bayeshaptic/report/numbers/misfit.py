"""Whether the residual is more than noise: one answer for the sentence, the sections, the JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.quantities import pure

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis


def misfit_is_clear(analysis: Analysis) -> bool:
    """Whether the model lacks something: a residual far beyond the noise, and not by chance."""
    return analysis.fit.misfits


def is_far_off(analysis: Analysis) -> bool:
    """Whether so much is left over that a limit widened for it is no advice either."""
    too_far = 3.0  # residual over noise
    return analysis.fit.reduced_chi_square > too_far**2


def misfit_is_faint(analysis: Analysis) -> bool:
    """Whether the residual is a little above the noise, but more than chance makes it."""
    above = analysis.fit.reduced_chi_square > analysis.fit.by_chance
    return above and not misfit_is_clear(analysis)


def residual_is_noticed(analysis: Analysis) -> bool:
    """Whether a test found more than noise in the residual, and nobody traced it."""
    return any(notice.topic == "residual" for notice in analysis.notices)


def misfit_factor(analysis: Analysis) -> str:
    """How many times the noise the residual is, for a sentence."""
    return pure(math.sqrt(analysis.fit.reduced_chi_square), 2)
