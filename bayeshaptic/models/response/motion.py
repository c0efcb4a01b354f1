"""The motion of a linear system in the time domain: what the command makes each mass do."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.response.filters import filtered
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomials.partial_fractions import moved_apart, residues
from bayeshaptic.types import Complexes, Floats


def linear_motion(system: LinearSystem, force: Floats, period_s: float) -> Floats:
    """Position and velocity of the motor at the samples, shape (2, N): see `linear_motions`."""
    return linear_motions(system, force, period_s, (0,))[0]


def linear_motions(
    system: LinearSystem, force: Floats, period_s: float, masses: tuple[int, ...], substeps: int = 1
) -> Floats:
    """Position and velocity of masses, from rest, for one parameter vector.

    Exact for a force held between the samples and delayed by the system's delay, with the filters
    in the loop: their poles are among those that are summed over.

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
    slow = 1e-5  # rad/s: what a pole at zero may be moved by, 6e-8 of the motion after a minute
    own = moved_apart(system.poles()[0], slow)
    poles = own[0]
    h = period_s / substeps
    delay = float(system.delay_s[0])
    whole = int(np.floor(delay / h + 1e-9))
    late = max(delay - whole * h, 0.0)
    kept = poles[poles.imag >= 0]
    twice = np.where(kept.imag > 0, 2.0, 1.0)
    rows = []
    for mass in masses:
        position = twice * _residues(system, own, mass)[poles.imag >= 0]
        rows += [position, position * kept]
    # One step: the old force until `late`, the new one after it.
    new = (h - late) * phi(kept * (h - late))
    old = np.exp(kept * (h - late)) * late * phi(kept * late)
    motion = modal_motion(force, substeps, whole, np.exp(kept * h), new, old, np.array(rows))
    return np.asarray(motion.reshape(len(masses), 2, -1))


def modal_motion(
    force: Floats,
    substeps: int,
    whole: int,
    decay: Complexes,
    new: Complexes,
    old: Complexes,
    weights: Complexes,
) -> Floats:
    """Rows of weighted sums over modes that a held force drives, from rest.

    Parameters
    ----------
    force : ndarray, shape (N,)
        Held over a period of `substeps` steps, and `whole` steps late.
    decay : complex ndarray, shape (P,)
        What is left of a mode after a step.
    new, old : complex ndarray, shape (P,)
        What a force gives a mode in a step, and the force of the step before.
    weights : complex ndarray, shape (R, P)

    Returns
    -------
    ndarray, shape (R, N * substeps)
        Real parts.
    """
    from bayeshaptic.models.response.kernels.motion import driven_modes

    # After some steps of a period a mode is what is left of it, and what the two forces gave it.
    left, of_new, of_old = [np.ones_like(decay)], [np.zeros_like(new)], [np.zeros_like(old)]
    for step in range(substeps):
        first = step == 0
        left.append(decay * left[-1])
        of_new.append(decay * of_new[-1] + (new if first else new + old))
        of_old.append(decay * of_old[-1] + (old if first else 0.0))
    modes = driven_modes(np.ascontiguousarray(force, float), left[-1], of_new[-1], of_old[-1])
    motion = np.zeros((len(weights), len(force) * substeps))
    for row, weight in zip(motion, weights, strict=True):
        seen = weight * np.array(left[:-1])
        given = np.array([of_new[:-1], of_old[:-1]]) @ weight
        table = np.concatenate([seen.real, -seen.imag, given.real.T], axis=1)
        row[whole:] = (modes @ table.T).ravel()[: max(len(row) - whole, 0)]
    return motion


def _residues(system: LinearSystem, poles: Complexes, mass: int) -> Complexes:
    numerator, denominator = filtered(*system.mechanism.transfer_to(mass), system.filters)
    return residues(numerator, denominator[-1], poles)[0]


def phi(x: Complexes) -> Complexes:
    """(e^x - 1) / x, and 1 at x = 0."""
    small = np.abs(x) < 1e-8
    safe = np.where(small, 1.0, x)
    return np.where(small, 1.0 + 0.5 * x, np.expm1(safe) / safe)
