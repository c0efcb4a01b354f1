"""Dry friction beside a constant force, where a mass moves one way only: what no slope shows."""

from __future__ import annotations

import numpy as np

from bayeshaptic.inference.time_domain.linearised import Linearised
from bayeshaptic.inference.time_domain.mass_in_loop import FORCES
from bayeshaptic.types import Floats

_NEAREST = 0.01  # of the command's rms
_CLEAR = 100.0  # times its noise, by which an error grows that other values make no smaller


def one_way(there: Linearised, spread: Floats) -> Floats:
    """Covariance that it adds to that of the values, shape (plain, plain).

    A mass that moves one way and rests says how large the sum (or the difference) of both is, and
    of friction that it holds the mass, or no more.  With more of both the motion is the same, for
    as far as friction holds the mass; the slopes are those at the very edge of that.  So both are
    moved until the error, everything else fitted with it, grows.

    Parameters
    ----------
    there : Linearised
        About the fitted values.
    spread : ndarray, shape (plain, plain)
        Covariance of the values by the slopes there.
    """
    loop, values, uneven = there.loop, there.values, there.uneven
    size = float(np.std(loop.force))
    others = np.delete(there.columns, FORCES, axis=1)
    gram = others.T @ others + np.diag(np.delete(there.found.share, FORCES))
    waves = there.columns[:, loop.plain :] @ uneven

    def power(moved: Floats) -> float:
        target = loop.error(moved, uneven) + waves
        along = others.T @ target
        return float(target @ target - along @ np.linalg.solve(gram, along))

    here = power(values)
    noise = here / loop.independent
    total = np.zeros_like(spread)
    for sign in (1.0, -1.0):
        along = np.zeros(len(values))
        along[FORCES] = 1.0, sign
        far, variance, grown = max(float(np.abs(values[FORCES]).sum()), _NEAREST * size), 0.0, 0.0
        while far < loop.reach[FORCES[0]] and grown < _CLEAR * noise:
            grown = power(values + far * along) - here
            variance = max(variance, far**2 * noise / max(grown, noise))
            far *= 2
        beyond = variance - spread[FORCES[0], FORCES[0]]
        if beyond > 0:
            total += beyond * np.outer(along, along)
    return total
