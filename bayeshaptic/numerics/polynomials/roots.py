"""All roots of many real polynomials at once, by Aberth's iteration, compiled.

As accurate as the coefficients are, each root relative to itself, however far apart they are;
`polynomial.roots` and eigenvalues are relative to the largest.

References
----------
O. Aberth, "Iteration methods for finding all zeros of a polynomial simultaneously", Mathematics of
Computation 27 (1973).  D. A. Bini, "Numerical computation of polynomial zeros by means of Aberth's
method", Numerical Algorithms 13 (1996), for where to begin.
"""

from __future__ import annotations

import math

import numpy as np

from bayeshaptic.compiled import kernel
from bayeshaptic.types import Bools, Complexes, Floats

_STEPS = 80
_EPS = 2.0**-52


@kernel
def find_roots(coefficients: Floats, found: Complexes, settled: Bools) -> None:
    """Roots of every row of coefficients, lowest power first, the highest not zero.

    Parameters
    ----------
    coefficients : ndarray, shape (B, n + 1)
    found : ndarray of complex, shape (B, n)
        Becomes the roots, in pairs that are exactly conjugate; exact zeros first.
    settled : ndarray of bool, shape (B,)
        Becomes False where the iteration has not come to rest, and the roots are of no use.
    """
    count = coefficients.shape[1]
    c, log = np.empty(count), np.empty(count)
    for row in range(len(coefficients)):
        zeros = 0
        while zeros < count - 1 and coefficients[row, zeros] == 0.0:
            found[row, zeros] = 0.0
            zeros += 1
        degree = count - 1 - zeros
        settled[row] = True
        for power in range(degree + 1):
            c[power] = coefficients[row, zeros + power] / coefficients[row, count - 1]
            size = abs(c[power])
            log[power] = math.log(size) if size > 0 else -1e300
            settled[row] &= math.isfinite(c[power])
        if settled[row] and degree > 0:
            z = found[row, zeros:]
            _begin(log, degree, z)
            settled[row] = _iterate(c, degree, z)
            _pair(z)


@kernel(inline=True)
def _begin(log: Floats, degree: int, z: Complexes) -> None:
    """Points on circles whose radii are the slopes of the upper hull of log |c| over the power."""
    first = 0
    while first < degree:
        last, slope = first + 1, -1e308
        for power in range(first + 1, degree + 1):
            steepness = (log[power] - log[first]) / (power - first)
            if steepness >= slope:
                last, slope = power, steepness
        radius = math.exp(min(max(-slope, -600.0), 600.0))
        for number in range(first, last):
            angle = 2 * math.pi * (number - first + 0.25) / (last - first) + 0.7 * first + 0.4
            z[number] = radius * complex(math.cos(angle), math.sin(angle))
        first = last


@kernel(inline=True)
def _iterate(c: Floats, degree: int, z: Complexes) -> bool:
    """Whether every root has come to rest."""
    resting = 0
    rests = np.zeros(degree, np.bool_)
    for _ in range(_STEPS):
        for number in range(degree):
            if rests[number]:
                continue
            x = z[number]
            size = abs(x)
            value, slope, bound = complex(c[degree], 0.0), 0j, abs(c[degree])
            for power in range(degree - 1, -1, -1):
                slope = slope * x + value
                value = value * x + c[power]
                bound = bound * size + abs(c[power])
            if abs(value) <= 2 * _EPS * bound:
                rests[number] = True
                resting += 1
                continue
            others = 0j
            for other in range(degree):
                if other != number:
                    others += 1.0 / (x - z[other])
            step = value / (slope - value * others)
            z[number] = x - step
            if not math.isfinite(abs(step)):
                return False
            if abs(step) <= _EPS * size:
                rests[number] = True
                resting += 1
        if resting == degree:
            return True
    return False


@kernel(inline=True)
def _pair(z: Complexes) -> None:
    """Make roots that are nearly conjugate so, and the others real."""
    done = np.zeros(len(z), np.bool_)
    for number in range(len(z)):
        if done[number]:
            continue
        done[number] = True
        mate, nearest = -1, abs(z[number].imag)
        for other in range(number + 1, len(z)):
            away = abs(z[other] - z[number].conjugate())
            if not done[other] and away < nearest:
                mate, nearest = other, away
        if mate < 0:
            z[number] = z[number].real
        else:
            done[mate] = True
            z[number] = 0.5 * (z[number] + z[mate].conjugate())
            z[mate] = z[number].conjugate()
