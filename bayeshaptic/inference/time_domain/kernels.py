"""One mass with viscous and dry friction in a sampled loop, in one compiled pass."""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats

_REVERSALS = 4  # within one hold; the velocity then is next to nothing


@kernel(inline=True)
def _coast(
    x: float, v: float, force: float, rate: float, mass: float, dry: float, t: float
) -> tuple[float, float]:
    """Position and velocity after `t` seconds under a constant force, reversals located exactly.

    m x'' = force - b x' - dry sign(x'), rate = b / m; at rest while |force| <= dry.
    """
    for _ in range(_REVERSALS):
        if v > 0:
            net = force - dry
        elif v < 0:
            net = force + dry
        elif force > dry:
            net = force - dry
        elif force < -dry:
            net = force + dry
        else:
            return x, 0.0
        pull = net / mass
        span = t
        for _ in range(2):  # to the end, or to where it comes to rest
            if rate * span > 1e-6:
                left = math.exp(-rate * span)
                once = (1 - left) / rate
                twice = (span - once) / rate
            else:
                left = 1 - rate * span
                once = span * (1 - 0.5 * rate * span)
                twice = 0.5 * span * span
            end = v * left + pull * once
            if span < t or v * end >= 0 or v == 0:
                break
            share = -rate * v / pull
            span = math.log1p(share) / rate if share > 1e-9 else -v / pull
            span = min(max(span, 0.0), t * (1 - 1e-12))
        x += v * once + pull * twice
        if span == t:
            return x, end
        v = 0.0
        t -= span
    return x, v


@kernel
def follow(
    values: Floats,
    forward: Floats,
    backward: Floats,
    command: Floats,
    measured: Floats,
    above: Floats,
    below: Floats,
    period_s: float,
) -> Floats:
    """The simulated position at the samples, shape (N,); inf from where it runs away.

    Parameters
    ----------
    values : ndarray, shape (7,)
        Mass, viscous damping, dry friction, constant force against the motor, delay, and position
        and velocity at the beginning.
    forward, backward : ndarray, shape (N,)
        A further force, s samples long, while the mass moves forward or backward.
    command, measured : ndarray, shape (N,)
        Held from sample to sample; the feedback of measured - simulated is added to it.
    above, below : ndarray
        Numerator and denominator (first coefficient 1) of that feedback, in powers of 1/z.
    period_s : float
    """
    mass, damping, dry, offset, delay, x, v = values
    count = len(command)
    whole = int(math.floor(delay / period_s))
    late = delay - whole * period_s
    rate = damping / mass
    acting, apart, back, out = np.zeros((4, count))
    ahead = True
    for k in range(count):
        out[k] = x
        if v > 0:
            ahead = True
        elif v < 0:
            ahead = False
        apart[k] = measured[k] - x
        total = 0.0
        for j in range(min(len(above), k + 1)):
            total += above[j] * apart[k - j]
        for j in range(1, min(len(below), k + 1)):
            total -= below[j] * back[k - j]
        back[k] = total
        acting[k] = command[k] + total
        more = (forward[k] if ahead else backward[k]) - offset
        now = acting[max(k - whole, 0)]
        before = acting[max(k - whole - 1, 0)]
        if late > 0:
            x, v = _coast(x, v, before + more, rate, mass, dry, late)
        x, v = _coast(x, v, now + more, rate, mass, dry, period_s - late)
        if not abs(x) < 1e9:
            out[k:] = np.inf
            break
    return out
