"""Words for one mass that was followed in time: where it was recorded, and what that means."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.quantities import interval
from bayeshaptic.recordings.checks.sufficiency import told_too_little

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis


@dataclass(frozen=True)
class MotionWords:
    """What a page says otherwise of a closed loop than of an open one.

    Attributes
    ----------
    where : str
    response : str
        Why the response is not read; a sentence.
    beside : str
        How the mass was simulated beside the measured motion.
    fitted : str
        The method, with the key of its reference.
    told : str
        What comes of it, the subject of a sentence.
    """

    where: str
    response: str
    beside: str
    fitted: str
    told: str


_CLOSED = MotionWords(
    "in closed loop",
    "The force was computed from the motion, so the measured response is biased, and so is all "
    "that is read from it.",
    "in the same loop",
    "closed-loop output error [janot2014]",
    "Parameters, limit and interval",
)
_OPEN = MotionWords(
    "in open loop",
    "The force says too little of the response for a limit to be read from it.",
    "under the same command",
    "output error, with a weak feedback of the error that keeps the two together [janot2014]",
    "The parameters",
)


def motion_words(analysis: Analysis) -> MotionWords:
    """The words for where the motion of an analysis was recorded."""
    return _CLOSED if told_too_little(analysis.notices) is None else _OPEN


def determined(analysis: Analysis) -> str:
    """What the motion says of the parameters, and what it leaves open; 90 % intervals."""
    stated = analysis.stated
    leaves = stated.prior_dominated
    known = [
        f"{stated.model.parameter(name).title} "
        f"{interval(found['q05'], found['q95'], stated.model.unit(name))}"
        for name, found in stated.summary().items()
        if not leaves[name]
    ]
    text = (
        f"It was recorded {motion_words(analysis).where}, as far as it shows, and followed in time "
        f"as one mass: {', '.join(known)} (90 %)."
    )
    left = [stated.model.parameter(name).title for name in stated.names if leaves[name]]
    return f"{text} It leaves open: {', '.join(left)}." if left else text
