"""Roots in brackets, many at once: Chandrupatla's method.

As `scipy.optimize.elementwise.find_root`, at half its time where brackets are few hundreds, and
without SciPy's optimisers, which take a twentieth of a second to import.

References
----------
T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a nonlinear
function without using derivatives", Advances in Engineering Software 28 (1997).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayeshaptic.types import Floats, Ints

_MOST = 100  # steps; bisection alone needs some fifty


def roots_between(
    function: Callable[[Floats, Ints], Floats], low: Floats, high: Floats, tolerance: float
) -> Floats:
    """Where a function changes its sign in each bracket; nan where it does not.

    Parameters
    ----------
    function : callable
        Of places, shape (m,), and of the brackets' numbers, shape (m,).
    low, high : ndarray, shape (M,)
    tolerance : float
        Of a root, relative to it.

    Returns
    -------
    ndarray, shape (M,)
    """
    found = np.full(len(low), np.nan)
    every = np.arange(len(low))
    ends = function(low, every), function(high, every)
    open_ = np.flatnonzero(np.sign(ends[0]) * np.sign(ends[1]) <= 0)
    a, b, fa, fb = (part[open_] for part in (low, high, *ends))
    c, fc = b, fb  # no third point yet
    for _ in range(_MOST):
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        found[open_] = best
        with np.errstate(divide="ignore", invalid="ignore"):
            least = tolerance * np.abs(best) / np.abs(b - a)  # share of the way that counts
        left = (least <= 0.5) & (fa != 0) & (fb != 0)
        if not left.all():
            parts = (open_, a, b, c, fa, fb, fc, least)
            open_, a, b, c, fa, fb, fc, least = (part[left] for part in parts)
        if not len(open_):
            break
        x = a + np.clip(_share(a, b, c, fa, fb, fc), least, 1 - least) * (b - a)
        fx = function(x, open_)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
    return found


def _share(a: Floats, b: Floats, c: Floats, fa: Floats, fb: Floats, fc: Floats) -> Floats:
    """By a parabola through the inverse function where that is safe, else the middle."""
    with np.errstate(divide="ignore", invalid="ignore"):
        xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
        safe = (phi * phi < xi) & ((1 - phi) * (1 - phi) < 1 - xi)
        inner = fa / (fb - fa) * fc / (fb - fc)
        inner += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    return np.where(safe, inner, 0.5)
