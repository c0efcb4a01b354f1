"""What closing the loop left without a name, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.quantities import interval, pure, quantity
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.misfit import is_far_off
from bayeshaptic.report.numbers.unstated import unstated
from bayeshaptic.report.objections import why_none

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.diagnosis.residuals.residual import Test

MEASURE_NEXT = {
    "linear": "Record the device with a known mass fixed to the part that you suspect: the mode "
    "that moves belongs to it. An accelerometer on the base or on the handle shows motion that the "
    "encoder does not see.",
    "nonlinear": "Record at half and at twice the force: what changes with the level is not "
    "linear. A relay experiment measures the limit itself, at its own amplitude.",
    "time-varying": "Record for a shorter time, and with nobody holding the device: if it still "
    "changes, look for warmth and play in the device, else at the grip.",
    "measurement": "Record with the force at zero: what the encoder shows then is not the "
    "device. Look at the resolution, the time stamps and the cable of the encoder.",
}


def remainder(closed: Closed) -> tuple[str, ...]:
    """What there is, what was tried, what it does to the limit, what to measure next."""
    left = [test for test in closed.traced.after if test.flagged]
    top = worst(tuple(left))
    assert top is not None
    families = dict.fromkeys(test.family for test in sorted(left, key=lambda t: -t.excess))
    more = "more " if closed.effects else ""
    where = "" if top.frequency_hz is None else f", around {quantity(top.frequency_hz, 'Hz')}"
    first = (
        f"There is something {more}here that has no name in the library. Its class is "
        f"{listed(families)}{where}: {top.text} (noticed from {pure(top.threshold)} on). "
        f"{_tried(closed)}"
    )
    advice = [MEASURE_NEXT[family] for family in families if family in MEASURE_NEXT]
    if "linear" in families and closed.model.held:
        advice.append("Record it with nobody holding it, too: then the hand is not in question.")
    return first, _widened(closed), f"What to measure next: {' '.join(advice)}"


def _tried(closed: Closed) -> str:
    # The last round is the one that found nothing for what is left.
    last = max((c.round for c in closed.traced.candidates), default=0)
    tried = [c for c in closed.traced.candidates if c.round == last and not c.accepted]
    if not tried:
        return "No effect of the library that could be behind it explains any of it."
    names = ", ".join(c.title for c in sorted(tried, key=lambda c: -c.score))
    return (
        f"Tried without success, the best first: {names}. None of them predicts the part of the "
        "recording that it was not fitted to well enough to be believed."
    )


def _widened(closed: Closed) -> str:
    from bayeshaptic.stability.critical import critical_stiffness

    limit = closed.analysis.limit
    if unstated(closed.analysis) is not None:
        return "No critical stiffness is stated."
    narrow = critical_stiffness(closed.analysis.posterior)
    before = interval(narrow.quantile(0.05), narrow.quantile(0.95), limit.unit)
    after = interval(limit.quantile(0.05), limit.quantile(0.95), limit.unit)
    text = (
        f"The critical stiffness was widened for it: without that its 90 % interval would be "
        f"{before}; it is {after}"
    )
    if is_far_off(closed.analysis):
        return f"{text}. Neither is of use: so much is left that nothing follows from it."
    if why_none(closed):
        return f"{text}. That is for comparison only, for the reason given at the top of the page."
    return f"{text}. Use its lower end."


def worst(tests: tuple[Test, ...]) -> Test | None:
    """The test that is furthest beyond its threshold, or nearest to it."""
    return max(tests, key=lambda test: test.excess, default=None)
