"""Gauss-Newton steps to the values of a loop whose motion is nearest to the measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.between_pieces import between_pieces
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES, SHARED, MassInLoop
from bayeshaptic.inference.time_domain.one_way import one_way
from bayeshaptic.inference.time_domain.uneven import WAVES, Ridge, ridge
from bayeshaptic.inference.time_domain.widths import covariance, of_white
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

_STUCK = 0.5  # of the error's power, that a settled fit does not promise to take away


@dataclass(frozen=True)
class Descended:
    """A fit with one follower.

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


def descend(loop: MassInLoop, start: Floats, name: str) -> Descended:
    """Gauss-Newton steps, first without the uneven force, then with it."""
    values, uneven = start, np.zeros(2 * WAVES)
    plain = loop.plain
    steps = 10
    for with_waves in (False, True):
        converged = False
        for _ in range(steps):
            error, columns, solved = _linearised(loop, values, uneven, with_waves, name)
            better = _step(loop, values, uneven, error, solved)
            if better is None:
                converged = True
                break
            values, uneven, gain = better
            if gain < 1e-4:
                converged = True
                break
    error, columns, solved = _linearised(loop, values, uneven, True, name)
    left = error + columns[:, plain:] @ uneven - columns @ solved.solution
    promised = error + columns[:, plain:] @ uneven - columns @ _within(loop, values, solved)
    # Where no step is any better, but a line promises much, it is stuck.
    converged = converged and bool(promised @ promised > (1 - _STUCK) * (error @ error))
    spread = _spread(loop, values, uneven, columns, left, solved)
    best = values + solved.solution[: loop.plain]
    return Descended(best, values, uneven, spread, error, solved, converged)


def _spread(
    loop: MassInLoop, values: Floats, uneven: Floats, columns: Floats, left: Floats, solved: Ridge
) -> Floats:
    """Covariance of the values, (V, V): within pieces, between them, and of what goes one way."""
    plain = loop.plain
    if loop.white:
        spread = of_white(left, solved, loop.independent)
    else:
        spread = covariance(columns, left, solved, loop.independent, SHARED)
    friction = np.array([NAMES.index("b"), NAMES.index("coulomb")])
    own = loop.pieces, friction, loop.beginnings
    spread = spread + between_pieces(columns, left, solved, *own, loop.independent)
    spread = spread[:plain, :plain]
    # A fit that leaves less than rounding does, as where the mass rests for long, follows that.
    rounded = (increment_unit(loop.position) or 0.0) ** 2 / 12
    spread *= max(1.0, rounded * len(left) / float(left @ left))
    return spread + one_way(loop, values, uneven, columns, solved, spread)


def _linearised(
    loop: MassInLoop, values: Floats, uneven: Floats, with_waves: bool, name: str
) -> tuple[Floats, Floats, Ridge]:
    """The error, its slopes, and the linear problem's solution for the step and all waves."""
    plain = loop.plain
    error = loop.error(values, uneven)
    columns = loop.columns(values, uneven, error)
    if not (np.all(np.isfinite(error)) and np.all(np.isfinite(columns))):
        raise InputError(f"{name}: no motion of one mass stays near the measured one")
    if not with_waves:
        columns[:, plain:] = 0.0
    size = float(np.std(loop.force))
    target = error + columns[:, plain:] @ uneven
    return error, columns, ridge(columns, target, plain, size, loop.independent, loop.reach)


def _step(
    loop: MassInLoop, values: Floats, uneven: Floats, error: Floats, solved: Ridge
) -> tuple[Floats, Floats, float] | None:
    """As much of the step as lowers the penalised error, and by which share; None where none."""
    plain, lowest, highest = loop.plain, loop.lowest, loop.highest
    penalty = solved.share[plain:]
    before = float(error @ error + penalty @ uneven**2)
    share, step = 1.0, _within(loop, values, solved)
    for _ in range(6):
        trial = np.clip(values + share * step[:plain], lowest, highest)
        trial[0] = np.clip(trial[0], 0.5 * values[0], 2 * values[0])
        more = uneven + share * (step[plain:] - uneven)
        left = loop.error(trial, more)
        after = float(left @ left + penalty @ more**2)
        if after < before:
            return trial, more, 1 - after / before
        share *= 0.4
    return None


def _within(loop: MassInLoop, values: Floats, solved: Ridge) -> Floats:
    """The solution where no value leaves what is possible: the others make up for those held."""
    plain = loop.plain
    low, high = loop.lowest - values, loop.highest - values
    step, held = solved.solution, np.zeros(plain, dtype=bool)
    for _ in range(plain):
        out = ~held & ((step[:plain] < low) | (step[:plain] > high))
        if not np.any(out):
            break
        held |= out
        (at,) = np.nonzero(held)
        beyond = solved.solution[at] - np.clip(solved.solution[at], low[at], high[at])
        own = solved.inverse[np.ix_(at, at)]
        step = solved.solution - solved.inverse[:, at] @ np.linalg.solve(own, beyond)
    return step
