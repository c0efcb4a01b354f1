"""Many bracketed roots at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bayeshaptic.types import Floats, Ints


def bracketed_roots(
    function: Callable[[Ints, Floats], Floats],
    low: Floats,
    high: Floats,
    f_low: Floats,
    f_high: Floats,
    tolerance: float = 1e-13,
) -> Floats:
    """A root in each of M brackets, by Chandrupatla's method.

    Inverse quadratic interpolation where it is safe, bisection elsewhere; needs no derivative and
    never leaves its bracket.  Converged brackets drop out of the calls.

    Parameters
    ----------
    function : callable
        ``function(index, x)``: values of the functions number `index` at the points `x`, both of
        shape (m,).
    low, high, f_low, f_high : ndarray, shape (M,)
        Brackets and the values at their ends, of opposite sign.
    tolerance : float
        Relative to the root.

    Returns
    -------
    ndarray, shape (M,)

    References
    ----------
    T. R. Chandrupatla, "A new hybrid quadratic/bisection algorithm for finding the zero of a
    nonlinear function without using derivatives", Advances in Engineering Software 28 (1997).
    """
    root = np.array(low, float)
    index = np.arange(len(root))
    a, b, fa, fb = low, high, f_low, f_high
    t = np.full(len(root), 0.5)
    for _ in range(100):
        x = a + t * (b - a)
        fx = function(index, x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        root[index] = best
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            limit = tolerance * np.abs(best) / np.abs(b - a)
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            safe = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
            step = fa / (fb - fa) * fc / (fb - fc)
            step += (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        open_ = (limit <= 0.5) & (fa != 0) & (fb != 0)
        if not open_.any():
            break
        t = np.clip(np.where(safe, step, 0.5), limit, 1 - limit)[open_]
        index, a, b, fa, fb = index[open_], a[open_], b[open_], fa[open_], fb[open_]
    return root
