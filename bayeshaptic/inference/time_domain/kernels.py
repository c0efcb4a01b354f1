"""One mass with friction and other forces on it in a sampled loop, in one compiled pass.

It contains `integrated` of `held_force.py`, and is to be compiled anew where that is changed.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.compiled import kernel
from bayeshaptic.inference.time_domain.held_force import integrated
from bayeshaptic.types import Floats

_REVERSALS = 4  # within one hold; the velocity then is next to nothing
_integrated = kernel(inline=True)(integrated)


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
            kept, once, twice = _integrated(rate, span)
            end = v * kept + pull * once
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


@kernel(inline=True)
def _middle(v: float, force: float, damping: float, dry: float, gain: float) -> tuple[float, float]:
    """About the velocity in the middle and at the end of a step of length gain * mass."""
    way = 1.0 if v > 0 else -1.0 if v < 0 else 0.0
    last = v + gain * (force - way * dry - damping * v)
    if last * v < 0:
        last = 0.0
    return 0.5 * (v + last), last


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
    laws: tuple[Callable[..., float], ...],
    sticks: NDArray[np.bool_],
    constants: Floats,
    begins: tuple[int, ...],
) -> Floats:
    """The simulated position at the samples, shape (N,); inf from where it runs away.

    Parameters
    ----------
    values : ndarray, shape (6,)
        Mass, viscous damping, constant force against the motor, delay, and position and velocity at
        the beginning.
    forward, backward : ndarray, shape (N,)
        A further force, s samples long, while the mass moves forward or backward.
    command, measured : ndarray, shape (N,)
        Held from sample to sample; the feedback of measured - simulated is added to it.
    above, below : ndarray
        Numerator and denominator (first coefficient 1) of that feedback, in powers of 1/z.
    period_s : float
    laws : tuple of callable
        Further forces, as `Law.force`: compiled callbacks.
    sticks : ndarray of bool, shape (F,)
        Which of them are dry friction, and give its largest size.
    constants : ndarray
        Strength and shape of all laws, one after the other.
    begins : tuple of int
        Where those of each law begin.
    """
    mass, damping, offset, delay, x, v = values
    count = len(command)
    whole = int(math.floor(delay / period_s))
    late = delay - whole * period_s
    rate = damping / mass
    acting, apart, back, out = np.zeros((4, count))
    ahead, dry = True, 0.0
    before = np.zeros(len(laws))
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
        for part in range(2):  # before and after the command of this sample arrives
            span = late if part == 0 else period_s - late
            if not span > 0:
                continue
            force = acting[max(k - whole - 1 + part, 0)] + more
            gain = span / mass
            middle, last = _middle(v, force, damping, dry, gain)
            dry, pushed = 0.0, 0.0
            for f in range(len(laws)):
                own = constants[begins[f] :].ctypes
                way = x + 0.5 * span * middle
                found = laws[f](way, middle, last, gain, before[f], span, own)
                if sticks[f]:
                    dry += found
                else:
                    pushed += found
                    before[f] = found
            x, v = _coast(x, v, force + pushed, rate, mass, dry, span)
        if not abs(x) < 1e9:
            out[k:] = np.inf
            break
    return out
