"""The covariance of a fitted loop's values, by all that may move them."""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.time_domain.linearised import Linearised
from bayeshaptic.inference.time_domain.mass_in_loop import DAMPING, DRY, FORCES, SHARED
from bayeshaptic.inference.time_domain.uneven import WAVES, Ridge
from bayeshaptic.inference.time_domain.widths.between_pieces import between_pieces
from bayeshaptic.inference.time_domain.widths.correlated import covariance, of_white
from bayeshaptic.inference.time_domain.widths.one_way import one_way
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

# How far the mean of a half wave along the way goes with the way's ends, of its standard deviation.
# Of 199 loops 90 % intervals hold dry friction and constant force in 90 and 82 % without it, in 98
# and 94 % with 0.05; the constant force published of EMPS is 0.15 of one off the mean over the way
# and three standard deviations beside.
_ENDS = 0.2


def covariance_of_values(there: Linearised) -> Floats:
    """Shape (V, V): within pieces, between them, and of what goes one way."""
    loop, columns, found = there.loop, there.columns, there.found
    left = there.without(found.solution)
    if loop.white:
        spread = of_white(left, found, loop.independent)
    else:
        spread = covariance(columns, left, found, loop.independent, SHARED)
    friction = np.array([DAMPING, DRY])
    own = loop.pieces, friction, loop.beginnings
    spread = spread + between_pieces(columns, left, found, *own, loop.independent)
    spread = spread[: loop.plain, : loop.plain]
    # A fit that leaves less than rounding does, as where the mass rests for long, follows that.
    rounded = (increment_unit(loop.position) or 0.0) ** 2 / 12
    spread *= max(1.0, rounded * len(left) / float(left @ left))
    return spread + one_way(there, spread)


def covariance_of_shared(whole: Floats, found: Ridge) -> Floats:
    """Of the values that all pieces share, shape (5, 5), of that of all values.

    Dry friction and constant force are means over the way.  That of a force with the waves' prior
    is not known: a share of the variance of its longest half wave, as how much of it lies in the
    constant is a matter of where the way happens to begin and to end.
    """
    spread = whole[:SHARED, :SHARED].copy()
    spread[FORCES, FORCES] += float(_ENDS**2 * found.prior[-WAVES])
    return spread
