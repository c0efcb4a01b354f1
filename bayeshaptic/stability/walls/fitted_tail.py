"""The stiffness over damping at a risk that hardly any of the draws lie below.

As without damping: at each damping a tail is fitted to the lowest limits (`stability.tail`), so
that a risk that is stated for K_CR is stated for walls with damping, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np

from bayeshaptic.stability.tail import low_quantile
from bayeshaptic.stability.walls.joint import lowest
from bayeshaptic.types import Floats


def fitted_boundary(
    limits: Sequence[Floats], effective: Sequence[float], risk: float, larger: Floats
) -> Floats | None:
    """The stiffness at a small risk at each damping, shape (J,); None where no tail says it.

    Parameters
    ----------
    limits : sequence of ndarray, shapes (n_c, J)
        Of each case, each column in ascending order; cases are independent.
    effective : sequence of float
        Effective number of draws of each case.
    risk : float
    larger : ndarray, shape (J,)
        The stiffness at a larger risk, which that at a smaller one is never above.
    """
    joint = lowest(limits, [len(part) for part in limits])
    count = max(len(part) for part in limits)
    shares = (np.arange(count) + 0.5) / count
    found = np.zeros(len(larger))
    # Where as many draws as the risk have no stable wall at all, there is nothing to fit: 0 it is.
    for level in np.flatnonzero((larger > 0) & (joint.quantile(risk) > 0)):
        columns = [part[:, level] for part in limits]
        place = np.searchsorted(joint.share[:, level], shares)
        samples = joint.places[np.minimum(place, len(joint.places) - 1), level]
        value = low_quantile(samples, risk, partial(_effective_at, columns, effective))
        if value is None:
            return None
        found[level] = min(max(value.value, 0.0), larger[level])
    return found


def _effective_at(columns: Sequence[Floats], effective: Sequence[float], stiffness: float) -> float:
    """Independent draws that the share below a stiffness is as well known from.

    As in `DeviceLimit.effective_at`, with one effective number for each case.
    """
    shares = [np.searchsorted(own, stiffness) / len(own) for own in columns]
    if max(shares) >= 1 or max(shares) == 0:
        return float(min(effective))
    above = float(np.prod([1 - share for share in shares]))
    variance = sum(s / (1 - s) / n for s, n in zip(shares, effective, strict=True))
    return float((1 - above) / (above * variance))
