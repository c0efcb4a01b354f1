"""The sampled closed loop as one matrix: the slow and obvious witness of every limit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models.response.filters import Filter
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.types import Floats


def spectral_radius(system: LinearSystem, period_s: float, stiffness: Floats) -> Floats:
    """Largest modulus of the poles of the loop u[k] = -K y[k]; below 1 it is stable.

    The plant between samples is integrated exactly by matrix exponentials.  With the delay
    td = d T + e, the force u[k - d - 1] acts for the first e of a period and u[k - d] for the rest,

        x[k+1] = e^{AT} x[k] + e^{A(T-e)} (int_0^e e^{As} ds) B u[k-d-1]
                             + (int_0^{T-e} e^{As} ds) B u[k-d],

    and the last d + 1 forces are states of their own.

    Parameters
    ----------
    system : LinearSystem
        A batch of B loops.
    period_s : float
    stiffness : ndarray, shape (B,) or (B, J)
        J gains for each loop.

    Returns
    -------
    ndarray of the shape of `stiffness`
    """
    stiffness = np.asarray(stiffness, float)
    gains = stiffness.reshape(system.batch, -1)
    open_loop, entry, output = _sampled_loop(system, period_s)
    loop = open_loop[:, None] - gains[:, :, None, None] * (
        entry[:, None, :, None] * output[:, None, None, :]
    )
    radius = np.abs(np.linalg.eigvals(loop)).max(axis=-1)
    return radius.reshape(stiffness.shape)


def confirms(
    system: LinearSystem, period_s: float, critical: Floats, step: float = 1e-4
) -> NDArray[np.bool_]:
    """Whether each loop is stable just below its critical stiffness and unstable just above.

    Where the critical stiffness is 0 the loop must be unstable at small gains, where it is infinite
    this cannot be said and counts as confirmed.

    Parameters
    ----------
    critical : ndarray, shape (B,)
    step : float
        Relative distance of the two probes from the limit.

    Returns
    -------
    ndarray of bool, shape (B,)
    """
    finite = np.isfinite(critical)
    safe = np.where(finite, critical, 0.0)
    radius = spectral_radius(system, period_s, safe[:, None] * np.array([1 - step, 1 + step]))
    rounding = 1e-10
    stable_below = (radius[:, 0] < 1 + rounding) | (critical == 0)
    held = stable_below & (radius[:, 1] > 1 - rounding)
    return held | ~finite


def _sampled_loop(system: LinearSystem, period_s: float) -> tuple[Floats, Floats, Floats]:
    """Matrix of the states and past forces, where u[k] enters, and how y[k] is read."""
    a, b, c = _state_space(system)
    batch, n = b.shape
    # What takes a whole delay away may leave less than nothing, by rounding.
    whole = np.maximum(np.floor(system.delay_s / period_s), 0).astype(int)
    late = np.clip(system.delay_s - whole * period_s, 0.0, period_s)
    early = period_s - late
    step_early, force_early = _hold(a, b, early)
    step_late, force_late = _hold(a, b, late)
    old = np.einsum("bij,bj->bi", step_early, force_late)
    past = int(whole.max()) + 1
    rows = np.arange(batch)
    matrix = np.zeros((batch, n + past, n + past))
    matrix[:, :n, :n] = step_early @ step_late
    matrix[:, n + 1 :, n:-1] = np.eye(past - 1)
    matrix[rows, :n, n + whole] = old
    entry = np.zeros((batch, n + past))
    entry[:, n] = 1.0
    # u[k-d] is the newest force itself where d = 0, and the state number d - 1 elsewhere.
    now = whole == 0
    entry[now, :n] += force_early[now]
    matrix[rows[~now], :n, n + whole[~now] - 1] += force_early[~now]
    output = np.zeros((batch, n + past))
    output[:, :n] = c
    return matrix, entry, output


def _hold(a: Floats, b: Floats, duration: Floats) -> tuple[Floats, Floats]:
    """e^{At} and (int_0^t e^{As} ds) B for each loop's own duration t."""
    from scipy.linalg import expm

    batch, n = b.shape
    block = np.zeros((batch, n + 1, n + 1))
    block[:, :n, :n] = a
    block[:, :n, n] = b
    exponential = expm(block * duration[:, None, None])
    return exponential[:, :n, :n], exponential[:, :n, n]


def _state_space(system: LinearSystem) -> tuple[Floats, Floats, Floats]:
    """x' = A x + B u, y = C x of mechanism and filters, straight from the masses and links."""
    mechanism = system.mechanism
    masses = len(mechanism.masses)
    a = mechanism.state_matrix()
    drive = mechanism.drive_vector()
    b = np.zeros(a.shape[:2])
    b[:, masses:] = drive / np.stack(mechanism.masses, axis=-1)
    c = np.zeros(a.shape[:2])
    c[:, :masses] = drive
    for factor in system.filters:
        a, b, c = _filtered(factor, a, b, c)
    return a, b, c


def _filtered(factor: Filter, a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats, Floats]:
    """The filter in controllable form before a plant without direct feedthrough."""
    lead = factor.denominator[-1]
    order = len(factor.denominator) - 1
    bottom = (factor.denominator[:-1] / lead).T
    numerator = np.zeros((order + 1, a.shape[0]))
    numerator[: len(factor.numerator)] = factor.numerator / lead
    through = numerator[-1]
    read = numerator[:-1].T - through[:, None] * bottom
    batch, n = b.shape
    matrix = np.zeros((batch, n + order, n + order))
    matrix[:, :n, :n] = a
    matrix[:, :n, n:] = b[:, :, None] * read[:, None, :]
    matrix[:, n + np.arange(order - 1), n + 1 + np.arange(order - 1)] = 1.0
    matrix[:, n + order - 1, n:] = -bottom
    entry = np.zeros((batch, n + order))
    entry[:, :n] = b * through[:, None]
    entry[:, n + order - 1] = 1.0
    output = np.zeros((batch, n + order))
    output[:, :n] = c
    return matrix, entry, output
