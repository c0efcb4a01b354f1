"""Which parameters a misfit makes doubtful, although their intervals are narrow."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.report.numbers.misfit import misfit_is_clear, residual_is_noticed
from bayeshaptic.report.numbers.result import families_of, is_unexplained

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def doubtful_parameters(result: Result) -> dict[str, str]:
    """Name to the reason, for each parameter whose interval may miss its true value.

    A residual that is not explained, or feedback, makes all of them doubtful.  The posterior
    takes the fitted law of a force as exact; that makes those doubtful which taking it off moved
    by more than their own standard deviation.
    """
    analysis, closed = result.analysis, result.closed
    names = analysis.model.names
    if analysis.in_loop is not None:
        why = "; ".join(analysis.in_loop.doubts)
        return dict.fromkeys(names, why) if why else {}
    if has_feedback(analysis.notices):
        return dict.fromkeys(names, "feedback biases it")
    if closed is None and residual_is_noticed(analysis):
        return dict.fromkeys(names, "the residual is not noise")
    if is_unexplained(result) or misfit_is_clear(analysis):
        return dict.fromkeys(names, "part of the recording is unexplained")
    if closed is not None and "nonlinear" in families_of(result):
        return dict.fromkeys(_moved(closed), "the posterior takes the fitted force as exact")
    return {}


def _moved(closed: Closed) -> tuple[str, ...]:
    """Parameters that the fitted law of a force moved by more than their own error."""
    before, after = closed.base.fit, closed.analysis.fit
    sd = closed.analysis.posterior.draws.std(axis=0)
    known = dict(zip(before.model.names, before.theta, strict=True))
    return tuple(
        name
        for name, value, error in zip(after.model.names, after.theta, sd, strict=True)
        if name in known and np.abs(value - known[name]) > error
    )
