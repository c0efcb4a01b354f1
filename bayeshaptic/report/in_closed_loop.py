"""What is asked of a limit that was read in closed loop, beyond the usual."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.base.direct import AGAINST
from bayeshaptic.diagnosis.feedback.against_one_mass import WIDE, is_wide
from bayeshaptic.diagnosis.feedback.mode_above_band import VALLEY
from bayeshaptic.quantities import quantity
from bayeshaptic.report.numbers.result import hides_hand

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis


def in_closed_loop(analysis: Analysis, verdict: str | None) -> list[str]:
    """Why no stiffness can be recommended of a closed loop; empty where one can, and in open loop.

    Parameters
    ----------
    analysis : Analysis
    verdict : str or None
        Of closing the loop with what was measured.
    """
    found = []
    if analysis.etfe.through_reference:
        found = _through_reference(analysis, verdict)
    elif not analysis.etfe.direct:
        return []
    if is_wide(analysis.limit):
        found.append(WIDE)
    return found


def _through_reference(analysis: Analysis, verdict: str | None) -> list[str]:
    found = []
    if verdict == "unexplained":
        found.append(
            "something is left that is not noise, and in closed loop the response does not show "
            "how far that may take the limit"
        )
    if hides_hand(analysis):
        found.append(
            "somebody holds the device, and in closed loop another hand on another device explains "
            "the motion as well"
            if analysis.model.held
            else "nobody said whether somebody holds the device, which closed loops hide"
        )
    etfe, chosen = analysis.etfe, analysis.choice is not None
    if chosen and analysis.model.name == "rigid" and not etfe.moved_throughout:
        found.append(
            f"nothing moves the force above {quantity(etfe.band_hz[1], 'Hz')} but noise, "
            "and a vibration mode there may set a lower limit than that of one mass"
        )
    # Of 48 loops without such a force five are read so, and one loses its stiffness for this.
    if any(notice.topic == AGAINST for notice in analysis.notices):
        found.append(
            "a fit to all that moves finds a force that is not linear, which a fit to what the "
            "reference moves does not show"
        )
    if any(notice.topic == VALLEY for notice in analysis.notices):
        found.append("a vibration mode elsewhere explains what the reference moves as well")
    return found
