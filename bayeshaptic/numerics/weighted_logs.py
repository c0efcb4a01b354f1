"""A weighted sum of logarithms in plain arithmetic: the compiler makes vector instructions of it.

Kernels elsewhere contain it: they are to be compiled anew where it is changed.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Floats, Ints


@kernel(inline=True)
def _sum(x: Floats) -> float:
    """The sum of x, which is left behind with halves of it added to one another.

    One number after the other would have to wait for each sum before.
    """
    count = len(x)
    while count > 8 and count % 2 == 0:
        count //= 2
        for number in range(count):
            x[number] += x[count + number]
    total = 0.0
    for number in range(count):
        total += x[number]
    return total


@kernel(inline=True)
def weighted_logs(x: Floats, weight: Floats, mantissa: Ints, spare: Floats) -> float:
    """Sum of weight * log(x), in vector instructions; x > 0, not subnormal.

    The sum of x, inf or nan, where that is not finite; `spare` and then x are written over.
    """
    bits = x.view(np.int64)
    for number in range(len(x)):
        mantissa[number] = (bits[number] & 0xFFFFFFFFFFFFF) | 0x3FF0000000000000
    m = mantissa.view(np.float64)
    for number in range(len(x)):
        high = m[number] > 1.4142135623730951
        t = (0.5 * m[number] if high else m[number]) - 1.0
        t /= t + 2.0
        u = t * t
        series = 1 / 21 + 0.0 * u
        for odd in (19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0, 1.0):
            series = series * u + 1.0 / odd
        power = float((bits[number] >> 52) - 1023) + (1.0 if high else 0.0)
        # Not a number where x is infinite or none itself.
        spare[number] = weight[number] * (2.0 * t * series + power * 0.6931471805599453)
        spare[number] += 0.0 * x[number]
    total = _sum(spare)
    if not math.isfinite(total):
        total = _sum(x)
    return total
