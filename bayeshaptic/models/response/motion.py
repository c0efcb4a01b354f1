"""The motion of a linear system in the time domain: what the command makes each mass do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from bayeshaptic.models.response.sampled import phi
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomial import evaluate
from bayeshaptic.types import Floats

_GAP = 1e-5  # between poles, rad/s


def linear_motion(
    system: LinearSystem, force: Floats, period_s: float, mass: int = 0, substeps: int = 1
) -> tuple[Floats, Floats]:
    """Position and velocity of one mass, from rest, for one parameter vector.

    Exact for a force held between the samples and delayed by the system's delay; filters in the
    loop are left out of the sum over poles only if there are none.

    Parameters
    ----------
    system : LinearSystem
        A batch of one.
    force : ndarray, shape (N,)
    period_s : float
    mass : int
        Number of the mass.
    substeps : int
        Points a period, the sample itself first.

    Returns
    -------
    position, velocity : ndarray, shape (N * substeps,)
    """
    poles = _apart(system.poles()[0][0])
    residues = _residues(system, poles, mass)
    h = period_s / substeps
    delay = float(system.delay_s[0])
    whole = int(np.floor(delay / h + 1e-9))
    late = max(delay - whole * h, 0.0)
    fine = np.repeat(np.asarray(force, float), substeps)
    held = np.concatenate([np.zeros(whole), fine])[: len(fine)]
    before = np.concatenate([[0.0], held[:-1]])
    position = np.zeros(len(fine))
    velocity = np.zeros(len(fine))
    for pole, residue in zip(poles, residues, strict=True):
        if pole.imag < 0:
            continue
        twice = 2.0 if pole.imag > 0 else 1.0
        # One step: the old force until `late`, the new one after it.
        new = (h - late) * phi(np.array(pole * (h - late)))
        old = np.exp(pole * (h - late)) * late * phi(np.array(pole * late))
        driven = new * held + old * before
        decay = np.exp(pole * h)
        state = lfilter([0.0, 1.0], [1.0, -decay], driven.astype(complex))
        position += twice * (residue * state).real
        velocity += twice * (residue * pole * state).real
    return position, velocity


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
