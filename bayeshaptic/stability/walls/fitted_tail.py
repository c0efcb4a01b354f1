"""The stiffness over damping at a risk that hardly any of the draws lie below.

As without damping: at each damping a tail is fitted to the lowest limits (`stability.tail`), so
that a risk that is stated for K_CR is stated for walls with damping, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial

import numpy as np

from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.stability.tail import low_quantile
from bayeshaptic.stability.walls.joint import lowest
from bayeshaptic.types import Floats

_NOTHING = 0.01  # of the stiffest wall
_ALIKE = 0.01  # of a stiffness, 0.1 dB, or of the damping where the boundary is steep


def fitted_boundary(
    damping: Floats,
    limits: Sequence[Floats],
    effective: Sequence[Callable[[float], float]],
    risk: float,
    larger: Floats,
) -> Floats | None:
    """The stiffness at a small risk at each damping, shape (J,); None where no tail says it.

    Parameters
    ----------
    damping : ndarray, shape (J,)
        Ascending.
    limits : sequence of ndarray, shapes (n_c, J)
        Of each case, each column in ascending order; cases are independent.
    effective : sequence of callable
        Of each case, from a share of the lowest limits to the effective number of draws that it is
        counted from; see `effective_of`.
    risk : float
    larger : ndarray, shape (J,)
        The stiffness at a larger risk, which that at a smaller one is never above.
    """
    joint = lowest(limits, [len(part) for part in limits])
    count = max(len(part) for part in limits)
    shares = (np.arange(count) + 0.5) / count
    found = joint.quantile(risk)
    if not np.isfinite(found).all():
        return None
    # Where as many draws as the risk have no stable wall, or hardly any, there is nothing to fit.
    slope = np.gradient(found, damping) if len(damping) > 1 else np.zeros(1)
    enough = _ALIKE * (found + damping * np.abs(slope))
    for level in np.flatnonzero(found > _NOTHING * found.max()):
        columns = [part[:, level] for part in limits]
        place = np.searchsorted(joint.share[:, level], shares)
        samples = joint.places[np.minimum(place, len(joint.places) - 1), level]
        worth = partial(_effective_at, columns, effective)
        value = low_quantile(samples, risk, worth, float(enough[level]))
        if value is None:
            return None
        found[level] = max(value.value, 0.0)
    return np.minimum(found, larger)


def effective_of(limit: CriticalStiffness, kept: int) -> Callable[[float], float]:
    """How many effective draws a share of the lowest limits is counted from.

    Neighbouring draws of a sampler are alike.  Which of them have the lowest limits over damping
    changes from step to step just as which have the lowest without damping, so that the number is
    that of K_CR.

    Parameters
    ----------
    limit : CriticalStiffness
        Of the case, from all draws.
    kept : int
        How many draws the limits over damping were computed for.

    Returns
    -------
    callable
        From a share, 0 to 1, to the effective number of draws.
    """

    @cache
    def behind(share: float) -> float:
        return min(float(kept), limit.effective_at(limit.quantile(share)))

    return lambda share: behind(round(share, 4))


def _effective_at(
    columns: Sequence[Floats], effective: Sequence[Callable[[float], float]], stiffness: float
) -> float:
    """Independent draws that the share below a stiffness is as well known from.

    As in `DeviceLimit.effective_at`.
    """
    shares = [float(np.searchsorted(own, stiffness) / len(own)) for own in columns]
    draws = [behind(share) for behind, share in zip(effective, shares, strict=True)]
    if max(shares) >= 1 or max(shares) == 0:
        return min(draws)
    above = float(np.prod([1 - share for share in shares]))
    variance = sum(s / (1 - s) / n for s, n in zip(shares, draws, strict=True))
    return float((1 - above) / (above * variance))
