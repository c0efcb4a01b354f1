"""Which parameters a misfit makes doubtful, although their intervals are narrow."""

from __future__ import annotations

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.report.numbers.misfit import misfit_is_clear, residual_is_noticed
from bayeshaptic.report.numbers.result import hides_hand, is_unexplained


def doubtful_parameters(result: Result) -> dict[str, str]:
    """Name to the reason, for each parameter whose interval may miss its true value.

    A residual that is not explained, or feedback, makes all of them doubtful.
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
    if hides_hand(analysis):
        return dict.fromkeys(names, "in closed loop another hand on another device does as well")
    return {}
