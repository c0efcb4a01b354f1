"""Forces over the velocity of a held device that may stand in for each other."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.effects.library import force_laws
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import LOAD_VELOCITY, VELOCITY

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


def stand_ins(closed: Closed) -> str | None:
    """Why two forces over the velocity leave a held device's limit open; None where they do not.

    Of twenty held devices with dry friction and a drag, in open loop, eighteen have these found
    and nineteen intervals hold; but where friction falls with the velocity besides (eight) others
    fit about as well, with medians of 0.27 to 1.8 times the limit (benchmarks/README.md).  Of
    eighteen devices with such pairs that nobody holds every interval holds; of eight held ones with
    one friction none is refused.
    """
    if not closed.analysis.model.held:
        return None
    if sum(map(_over_the_velocity, force_laws(closed.effect_names))) < 2:
        return None
    return (
        "two forces that go with the velocity were found on a device that somebody holds: others "
        "of the kind fit about as well, with another damping, and the limit may come out too high"
    )


def _over_the_velocity(kind: type[NonlinearEffect]) -> bool:
    if issubclass(kind, CommandEffect):
        return False
    return not {VELOCITY, LOAD_VELOCITY}.isdisjoint(kind.over)
