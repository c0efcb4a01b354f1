"""The motion of a linear system in the time domain: what the command makes each mass do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models.response.sampled import phi
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomial import evaluate
from bayeshaptic.types import Floats

_GAP = 1e-5  # between poles, rad/s


def linear_motion(
    system: LinearSystem, force: Floats, period_s: float, mass: int = 0, substeps: int = 1
) -> Floats:
    """Position and velocity of one mass, shape (2, N * substeps): see `linear_motions`."""
    return linear_motions(system, force, period_s, (mass,), substeps)[0]


def linear_motions(
    system: LinearSystem, force: Floats, period_s: float, masses: tuple[int, ...], substeps: int = 1
) -> Floats:
    """Position and velocity of masses, from rest, for one parameter vector.

    Exact for a force held between the samples and delayed by the system's delay; filters in the
    loop are left out of the sum over poles only if there are none.

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    force : ndarray, shape (N,)
    period_s : float
    masses : tuple of int
        Numbers of the masses.
    substeps : int
        Points a period, the sample itself first.

    Returns
    -------
    ndarray, shape (masses, 2, N * substeps)
    """
    from bayeshaptic.models.response.motion_kernel import modal_motion

    poles = _apart(system.poles()[0][0])
    h = period_s / substeps
    delay = float(system.delay_s[0])
    whole = int(np.floor(delay / h + 1e-9))
    late = max(delay - whole * h, 0.0)
    kept = poles[poles.imag >= 0]
    twice = np.where(kept.imag > 0, 2.0, 1.0)
    rows = []
    for mass in masses:
        position = twice * _residues(system, poles, mass)[poles.imag >= 0]
        rows += [position, position * kept]
    # One step: the old force until `late`, the new one after it.
    new = (h - late) * phi(kept * (h - late))
    old = np.exp(kept * (h - late)) * late * phi(kept * late)
    held = np.ascontiguousarray(force, float)
    motion = modal_motion(held, substeps, whole, np.exp(kept * h), new, old, np.array(rows))
    return np.asarray(motion.reshape(len(masses), 2, -1))


def _apart(poles: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """The poles, coinciding real ones moved apart by what decays 0.06 % in a minute.

    A rigid device without damping has two poles at zero, and the sum over poles has no term for a
    double one.
    """
    moved = poles.copy()
    for index in range(1, len(moved)):
        if moved[index].imag == 0 and np.abs(moved[:index] - moved[index]).min() < _GAP:
            moved[index] = moved[:index].real.min() - _GAP
    return moved


def _residues(
    system: LinearSystem, poles: NDArray[np.complex128], mass: int
) -> NDArray[np.complex128]:
    numerator, denominator = system.mechanism.transfer_to(mass)
    leading = denominator[-1, 0]
    values = evaluate(numerator, poles[:, None])[:, 0]
    for factor in system.filters:
        values = values * evaluate(factor.numerator, poles[:, None])[:, 0]
        leading = leading * factor.denominator[-1, 0]
    gaps = poles[:, None] - poles[None, :]
    np.fill_diagonal(gaps, 1.0)
    return np.asarray(values / (leading * gaps.prod(axis=1)))
