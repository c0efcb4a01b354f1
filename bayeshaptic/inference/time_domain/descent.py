"""Gauss-Newton steps to the values of a loop whose motion is nearest to the measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.inference.time_domain.linearised import Linearised, linearised
from bayeshaptic.inference.time_domain.mass_in_loop import MASS, MassInLoop
from bayeshaptic.inference.time_domain.uneven import WAVES, Ridge
from bayeshaptic.inference.time_domain.widths.of_values import covariance_of_values
from bayeshaptic.types import Floats

_STEPS, _TRIALS = 10, 6
_SHORTER = 0.4  # a step that does not lower the error, at the next trial
_SETTLED = 1e-4  # of the error's power, that a last step takes away
_STUCK = 0.5  # of the error's power, that a settled fit does not promise to take away


@dataclass(frozen=True)
class Descended:
    """A fit with one follower, without the slopes around it: of an hour these are a gigabyte.

    Attributes
    ----------
    values, inside : ndarray, shape (V,)
        Of the `MassInLoop`: where the data put them, and the best that are possible.
    uneven : ndarray, shape (2 WAVES,)
        The force that changes along the way.
    covariance : ndarray, shape (V, V)
    error : ndarray, shape (N,)
        Measured less simulated position.
    found : Ridge
        The linear problem around it.
    converged : bool
    """

    values: Floats
    inside: Floats
    uneven: Floats
    covariance: Floats
    error: Floats
    found: Ridge
    converged: bool


def descend(loop: MassInLoop, start: Floats) -> Descended:
    """Gauss-Newton steps, first without the uneven force, then with it."""
    values, uneven = start, np.zeros(2 * WAVES)
    converged = False
    for with_waves in (False, True):
        for _ in range(_STEPS):
            better = _step(linearised(loop, values, uneven, with_waves))
            if better is not None:
                values, uneven, gain = better
            converged = better is None or gain < _SETTLED
            if converged:
                break
    there = linearised(loop, values, uneven)
    promised = there.without(_within(there))
    # Where no step is any better, but a line promises much, it is stuck.
    stuck = not promised @ promised > (1 - _STUCK) * (there.error @ there.error)
    best, spread = values + there.found.solution[: loop.plain], covariance_of_values(there)
    settled = converged and not stuck
    return Descended(best, values, uneven, spread, there.error, there.found, settled)


def _step(there: Linearised) -> tuple[Floats, Floats, float] | None:
    """As much of the step as lowers the penalised error, and by which share; None where none."""
    loop, values, uneven, error = there.loop, there.values, there.uneven, there.error
    plain, penalty = loop.plain, there.found.share[loop.plain :]
    before = float(error @ error + penalty @ uneven**2)
    share, step = 1.0, _within(there)
    for _ in range(_TRIALS):
        trial = np.clip(values + share * step[:plain], loop.lowest, loop.highest)
        trial[MASS] = np.clip(trial[MASS], 0.5 * values[MASS], 2 * values[MASS])
        more = uneven + share * (step[plain:] - uneven)
        left = loop.error(trial, more)
        after = float(left @ left + penalty @ more**2)
        if after < before:
            return trial, more, 1 - after / before
        share *= _SHORTER
    return None


def _within(there: Linearised) -> Floats:
    """The solution where no value leaves what is possible: the others make up for those held."""
    loop, solved = there.loop, there.found
    low, high = loop.lowest - there.values, loop.highest - there.values
    step, held = solved.solution, np.zeros(loop.plain, dtype=bool)
    for _ in range(loop.plain):
        out = ~held & ((step[: loop.plain] < low) | (step[: loop.plain] > high))
        if not np.any(out):
            break
        held |= out
        (at,) = np.nonzero(held)
        beyond = solved.solution[at] - np.clip(solved.solution[at], low[at], high[at])
        own = solved.inverse[np.ix_(at, at)]
        step = solved.solution - solved.inverse[:, at] @ np.linalg.solve(own, beyond)
    return step
