"""Limits that are not stated: those decades from anything that was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.recordings.checks.sufficiency import told_too_little

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed

# A crossing may lie a decade below the band, where a mass is a hundred times as soft.
_FARTHEST = 1000.0


def unstated(analysis: Analysis) -> str | None:
    """Why no limit is stated; None where it is.

    The median is compared with the measured dynamic stiffness, 1/|G|: beyond a thousand times its
    range it is what the prior and the model's form make of a parameter that the data do not see.
    """
    if not analysis.sampled:
        return "feedback biases the response that it would be read from"
    if (too_little := told_too_little(analysis.notices)) is not None:
        return f"the recording says {too_little.reason}"
    limit = analysis.limit.quantile(0.5)
    size = np.abs(analysis.etfe.value)
    stiffness = 1 / size[size > 0]
    if limit == 0 or not math.isfinite(limit) or len(stiffness) == 0:
        return None  # "never stable" and "always" are answers
    if stiffness.min() / _FARTHEST < limit < stiffness.max() * _FARTHEST:
        return None
    return (
        "the model's limit lies decades from any stiffness that was measured, and is what the "
        "prior and the model's form make of a parameter that this recording does not see"
    )


def errors(closed: Closed) -> dict[str, dict[str, Any]]:
    """Errors before and after closing the loop, without limits that are not stated.

    ``before_like_after`` is of the model as declared beside the measurement that ``after`` is of:
    these two can be compared.
    """
    alike = closed.before if closed.before_like_after is None else closed.before_like_after

    def stated(error: Mapping[str, Any], analysis: Analysis) -> dict[str, Any]:
        limits = {"critical_stiffness": None, "critical_stiffness_db": None}
        return {**error, **(limits if unstated(analysis) is not None else {})}

    return {
        "before": stated(closed.before, closed.base),
        "before_like_after": stated(alike, closed.base),
        "after": stated(closed.after, closed.analysis),
    }
