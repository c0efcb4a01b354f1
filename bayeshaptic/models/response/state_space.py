"""The sampled response as matrices: hold, mechanism, filters and a delay of any length, exactly."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.linalg import expm
from scipy.signal import tf2ss

from bayeshaptic.errors import InputError
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.types import Floats

Matrices = tuple[Floats, Floats, Floats, Floats]


def state_space(system: LinearSystem, period_s: float) -> Matrices:
    """Matrices A, B, C, D of x[k + 1] = A x[k] + B u[k], y[k] = C x[k] + D u[k].

    Parameters
    ----------
    system : LinearSystem
        Of one parameter vector.
    period_s : float

    Raises
    ------
    InputError
        Where the system has no finite number of states.
    """
    if not system.rational:
        raise InputError(
            "this model has no finite number of states (a delayed or hysteretic force is inside of "
            "it): take its response instead."
        )
    top, bottom = (np.asarray(part, float)[:, 0] for part in system.transfer())
    # Time in periods: the coefficients are of s T, and of one size.
    top, bottom = (part / period_s ** np.arange(len(part)) for part in (top, bottom))
    a, b, c, _ = tf2ss(top[::-1] / bottom[-1], bottom[::-1] / bottom[-1])
    turns = float(system.delay_s[0]) / period_s
    whole = int(turns)
    early, now = _held(a, b, 1.0 - (turns - whole))
    late, before = _held(a, b, turns - whole)
    return _delayed(early @ late, now, early @ before, c, whole)


def of_python_control(system: LinearSystem, period_s: float) -> Any:
    """The same as a ``control.StateSpace``.

    Parameters
    ----------
    system : LinearSystem
        Of one parameter vector.
    period_s : float

    Raises
    ------
    InputError
        Where python-control is not installed, or the system has no finite number of states.
    """
    try:
        import control
    except ImportError:
        raise InputError(
            "python-control is not installed, and to_control() needs it: pip install control."
        ) from None
    return control.ss(*state_space(system, period_s), period_s)


def _held(a: Floats, b: Floats, share: float) -> tuple[Floats, Floats]:
    """e^{A t}, and its integral times B, over a share of the period."""
    size = len(a)
    both = np.zeros((size + 1, size + 1))
    both[:size, :size], both[:size, size:] = a, b
    grown = expm(both * share)
    return grown[:size, :size], grown[:size, size:]


def _delayed(a: Floats, now: Floats, before: Floats, c: Floats, whole: int) -> Matrices:
    """x[k + 1] = a x[k] + now u[k - whole] + before u[k - whole - 1], past forces being states."""
    size, memory = len(a), whole + 1
    every = np.zeros((size + memory, size + memory))
    every[:size, :size] = a
    every[size + 1 :, size:-1] = np.eye(memory - 1)  # the newest force first
    every[:size, -1:] = before
    force = np.zeros((size + memory, 1))
    force[size] = 1.0
    if whole:
        every[:size, -2:-1] = now
    else:
        force[:size] = now
    return every, force, np.hstack([c, np.zeros((1, memory))]), np.zeros((1, 1))
