"""A loop about some values, where steps are taken and widths are read off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.mass_in_loop import MassInLoop
from bayeshaptic.inference.time_domain.uneven import Ridge, ridge
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Linearised:
    """The error of a loop, how the motion moves with every value and wave, and the best of a line.

    Attributes
    ----------
    loop : MassInLoop
    values, uneven : ndarray
        About which.
    error : ndarray, shape (N,)
        Measured less simulated position.
    columns : ndarray, shape (N, C)
        As `MassInLoop.columns`.
    found : Ridge
        Of the linear problem: a step of the values, and the waves themselves.
    """

    loop: MassInLoop
    values: Floats
    uneven: Floats
    error: Floats
    columns: Floats
    found: Ridge

    @property
    def target(self) -> Floats:
        """What step and waves together are fitted to, shape (N,)."""
        return _target(self.loop, self.uneven, self.error, self.columns)

    def without(self, solution: Floats) -> Floats:
        """What a solution leaves of the error, if all were linear, shape (N,)."""
        return np.asarray(self.target - self.columns @ solution)


def linearised(
    loop: MassInLoop, values: Floats, uneven: Floats, with_waves: bool = True
) -> Linearised:
    """The loop about `values` and a force along the way, `uneven`; this held without waves.

    Raises
    ------
    InputError
        Where the simulated motion runs away.
    """
    error = loop.error(values, uneven)
    columns = loop.columns(values, uneven, error)
    if not (np.all(np.isfinite(error)) and np.all(np.isfinite(columns))):
        raise InputError(f"{loop.name}: no motion of one mass stays near the measured one")
    if not with_waves:
        columns[:, loop.plain :] = 0.0
    target, size = _target(loop, uneven, error, columns), float(np.std(loop.force))
    found = ridge(columns, target, loop.plain, size, loop.independent, loop.reach)
    return Linearised(loop, values, uneven, error, columns, found)


def _target(loop: MassInLoop, uneven: Floats, error: Floats, columns: Floats) -> Floats:
    return np.asarray(error + columns[:, loop.plain :] @ uneven)
