"""Forces that leave a limit open: others may be it, or most of the limit without one is theirs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.trials.forces.search import FIT_OF
from bayeshaptic.effects.library import effects, force_laws
from bayeshaptic.effects.nonlinear.protocol import CommandEffect, NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import LOAD_VELOCITY, VELOCITY
from bayeshaptic.quantities import pure
from bayeshaptic.stability.critical import critical_stiffness

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed


# Damping ratio of a Chebyshev filter of two poles and 3 dB of ripple, of those in use the least.
# None of 14 filters with ratios of 0.5 to 1 beside friction is refused: they are found within 1 %.
_OF_A_FILTER = 0.38
# Times the limit before a force was taken off: 14 to 27 in three recordings whose friction was 6 to
# 11 % too small and whose limits were 10 times too high.  None of 14 recordings of strangers in
# which a force was taken off is refused by it, nor of 86 others; five looked at have 1.0 to 1.5.
MOSTLY = 10.0


def stand_ins(closed: Closed) -> str | None:
    """Why forces over the velocity leave the limit open; None where they do not.

    Of four motors that rub and are read at the far end of a spring, 20 s each, medians were 0.83 to
    1.2 times the limit with the friction found, with intervals that do not hold it.

    Of twenty held devices with dry friction and a drag, in open loop, eighteen have these found
    and nineteen intervals hold; but where friction falls with the velocity besides (eight) others
    fit about as well, with medians of 0.27 to 1.8 times the limit (benchmarks/README.md).  Of
    eighteen devices with such pairs that nobody holds every interval holds; of eight held ones with
    one friction none is refused.
    """
    if (damping := _rings(closed)) is not None and _found(closed):
        return (
            "a force that goes with the velocity was found beside a low-pass on the position that "
            f"rings (damping ratio {pure(damping)}), as no filter does and a position that is read "
            "behind a spring: the motor, which rubs, moves otherwise than is read, and the limit "
            "may come out too high"
        )
    if not closed.analysis.model.held:
        return None
    if untried := not_tried(closed):
        return (
            "a force that goes with the velocity was found on a device that somebody holds, and "
            f"the budget of the search was spent before others were tried ({', '.join(untried)}): "
            "they may fit better, with another damping, and the limit may come out too high"
        )
    if _found(closed) < 2:
        return None
    return (
        "two forces that go with the velocity were found on a device that somebody holds: others "
        "of the kind fit about as well, with another damping, and the limit may come out too high"
    )


def is_the_rest(closed: Closed) -> bool:
    """Whether the limit is a small difference of two large ones, with a force and without it."""
    if not any(effect.family == "nonlinear" for effect in closed.effects):
        return False
    bare, after = closed.traced.without_forces, closed.analysis.limit.quantile(0.5)
    if bare is None or bare.model is closed.base.fit.model:
        before = float(closed.base.limit.quantile(0.5))
    else:  # what linear effects that were found first did to the limit is theirs
        before = critical_stiffness(bare.model, bare.theta).value
    return bool(math.isfinite(before) and before > MOSTLY * after)


def _rings(closed: Closed) -> float | None:
    """The damping ratio of a low-pass on the position, where no filter has so little."""
    if "position_filter" not in closed.effect_names:
        return None
    fit = closed.analysis.fit
    values = dict(zip(fit.model.names, fit.theta.tolist(), strict=True))
    damping = values.get("filter_damping")
    return damping if damping is not None and damping < _OF_A_FILTER else None


def not_tried(closed: Closed) -> tuple[str, ...]:
    """Titles of forces over the velocity that the budget had no room for, beside one found.

    A held device with dry friction and a drag had 1.37 times its limit in green with cubic damping
    alone, which the search ended at; with more of it both were found, and 1.04 times.
    """
    if not closed.analysis.model.held or not _found(closed):
        return ()
    skipped = {title.removesuffix(FIT_OF) for title in closed.traced.skipped}
    laws = (kind for kind in effects("nonlinear") if kind.title in skipped)
    return tuple(kind.title for kind in laws if _over_the_velocity(kind))


def _found(closed: Closed) -> int:
    """How many forces over the velocity were found."""
    return sum(map(_over_the_velocity, force_laws(closed.effect_names)))


def _over_the_velocity(kind: type[NonlinearEffect]) -> bool:
    if issubclass(kind, CommandEffect):
        return False
    return not {VELOCITY, LOAD_VELOCITY}.isdisjoint(kind.over)
