"""The stability limit of a bench from the eigenvalues of its closed sampled loop.

Nothing here looks at a frequency response: the state matrix of one period, delays as states, is
closed with u[k] = -K y[k] - B v[k], v the difference (y[k] - y[k-1])/T or that smoothed, and the
limit is the smallest K at which an eigenvalue leaves the unit circle. It is slow and obvious on
purpose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
import scipy.optimize

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Array, Plant
from bayeshaptic.rig.dynamics.propagate import generator, layout, period_map, split_delay, stretches
from bayeshaptic.rig.dynamics.step_tables import delay_lookup
from bayeshaptic.rig.setup import Setup

# Moments of the recording at which a mechanism that changes is looked at.
MOMENTS = 11
SCAN_POINTS = 1200
SCAN_DECADES = 7.0
# Substeps a period for delayed springs: in the scan, and in the refinement.
COARSE, FINE = 1, 8


@dataclass(frozen=True)
class TrueLimit:
    """The critical stiffness, N/m or N m/rad, and the frequency that the loop then shakes at."""

    stiffness: float
    frequency_hz: float


@dataclass(frozen=True)
class SampledLoop:
    """The open loop over one period: s[k+1] = matrix s[k] + column u[k], y[k] = row s[k].

    The state holds the plant, the commands that are still on their way, the signals that come back
    delayed, and y[k-1].

    Attributes
    ----------
    matrix : ndarray, shape (n, n)
    column, row : ndarray, shape (n,)
    previous : ndarray, shape (n,)
        Reads y[k-1].
    period_s : float
    """

    matrix: Array
    column: Array
    row: Array
    previous: Array
    period_s: float

    def closed(self, stiffness: Array, damping: float, smoothing: float = 0.0) -> Array:
        """State matrices of the closed loop, shape (K, n, n), for stiffnesses of shape (K,).

        With a `smoothing` a, the velocity is v[k] = a v[k-1] + (1 - a)(y[k] - y[k-1])/T, and v[k-1]
        one more state.
        """
        rate = (1 - smoothing) / self.period_s * (self.row - self.previous)
        feedback = np.asarray(stiffness)[:, None] * self.row + damping * rate
        loop = self.matrix - self.column[:, None] * feedback[:, None, :]
        if smoothing == 0.0:
            return loop
        n = len(self.row)
        whole = np.zeros((len(loop), n + 1, n + 1))
        whole[:, :n, :n] = loop
        whole[:, :n, n] = -damping * smoothing * self.column
        whole[:, n, :n] = rate
        whole[:, n, n] = smoothing
        return whole


def sampled_loop(plant: Plant, period_s: float, substeps: int = FINE) -> SampledLoop:
    """The linear part of a plant with its delays over one period.

    Dry friction and other nonlinear forces are left out. A delayed spring is a chain of its past
    signals, joined by straight lines.

    Parameters
    ----------
    plant : Plant
    period_s : float
        Sampling period, s.
    substeps : int
        Signals a period in such a chain.
    """
    if plant.delayed:
        drift, old, new = _period_with_chains(plant, period_s, substeps)
    else:
        period = period_map(plant, period_s)
        drift, old, new = period.phi, period.old, period.new
    n = len(drift)
    whole, _ = split_delay(plant.delay_s, period_s)
    # Behind the plant: u[k-1] .. u[k-d-1], then y[k-1].
    size = n + whole + 2
    matrix, column = np.zeros((size, size)), np.zeros(size)
    matrix[:n, :n] = drift
    matrix[:n, n + whole] = old
    if whole:
        matrix[:n, n + whole - 1] = new
    else:
        column[:n] = new
    column[n] = 1.0
    for age in range(whole):
        matrix[n + age + 1, n + age] = 1.0
    row = np.zeros(size)
    row[: plant.states] = plant.position
    matrix[-1] = row
    previous = np.zeros(size)
    previous[-1] = 1.0
    return SampledLoop(matrix, column, row, previous, period_s)


def _period_with_chains(plant: Plant, period_s: float, substeps: int) -> tuple[Array, Array, Array]:
    """One period as a matrix, and its answers to the old and the new command, with delayed springs.

    The state is the plant's, then the forces of the delayed springs, then for each of them its
    signal at the step boundaries: now, one step ago, and so on. The command is two more columns.
    """
    parts, at = stretches(plant.delay_s, period_s, substeps), layout(plant)
    n, springs = plant.states, len(plant.delayed)
    lookups = [delay_lookup(parts, period_s, spring.delay_s) for spring in plant.delayed]
    depth = max(back for lookup in lookups for back, _ in lookup) + 1
    size = n + springs + springs * depth
    state = np.eye(size, size + 2)
    piece = 0
    for part in parts:
        power = scipy.linalg.expm(generator(plant) * part.step_s)
        for _ in range(part.steps):
            end = power[:n, :n] @ state[:n]
            end[:, size + part.new] += power[:n, at.command]
            following = np.empty_like(state)
            for j, lookup in enumerate(lookups):
                force, first = state[n + j], n + springs + j * depth
                signal = state[first : first + depth]
                back, weight = lookup[piece]
                goal = (1 - weight) * signal[back] + weight * signal[max(back - 1, 0)]
                end += np.outer(power[:n, at.first_delayed + j], force)
                end += np.outer(power[:n, at.first_slope + j], (goal - force) / part.step_s)
                following[n + j] = goal
                following[first + 1 : first + depth] = signal[:-1]
            following[:n] = end
            following[n + springs :: depth] = plant.delayed_signals @ end
            state = following
            piece += 1
    return state[:, :size], state[:, size], state[:, size + 1]


def spectral_radius(
    bench: Setup, stiffness: float, damping: float = 0.0, cutoff_hz: float | None = None
) -> float:
    """Largest modulus of the closed loop's eigenvalues, at the beginning of the recording.

    Parameters
    ----------
    bench : Setup
    stiffness, damping : float
        Of the wall.
    cutoff_hz : float, optional
        Of the low-pass on the velocity of the damping term; see `run_wall`.

    Returns
    -------
    float
        Below 1 where the loop is stable.
    """
    loop = sampled_loop(bench.plant(), bench.period_s)
    a = smoothing_of(cutoff_hz, bench.period_s)
    return float(_radii(loop, np.array([stiffness]), damping, a)[0])


def smoothing_of(cutoff_hz: float | None, period_s: float) -> float:
    """The factor a of a first-order low-pass whose pole is exp(-2 pi cutoff T); 0 without one."""
    return 0.0 if cutoff_hz is None else float(np.exp(-2 * np.pi * cutoff_hz * period_s))


def critical_limit(bench: Setup, damping: float = 0.0) -> TrueLimit:
    """The smallest stiffness at which the wall loses stability.

    Parameters
    ----------
    bench : Bench
        Only its linear part counts. Where the mechanism changes during the recording, the worst of
        `MOMENTS` moments does.
    damping : float
        Damping B of the wall.

    Returns
    -------
    TrueLimit
        The stiffness is 0 where the loop is unstable from the first scanned stiffness on; the scan
        covers `SCAN_DECADES` below 40 m1/T^2 and as many above, `SCAN_POINTS` each, and the edge is
        then bisected.

    Raises
    ------
    InputError
        Where no edge is found. There is one: no position answers within its own sample, so that a
        stiffness that is large enough makes any loop unstable.
    """
    moments = np.linspace(0, 1, MOMENTS) if bench.varies else [0.0]
    limits = [_limit(bench, bench.plant(float(at)), damping) for at in moments]
    return min(limits, key=lambda limit: limit.stiffness)


def _radii(loop: SampledLoop, stiffness: Array, damping: float, smoothing: float = 0.0) -> Array:
    """Largest modulus of the eigenvalues for each of K stiffnesses, shape (K,)."""
    return np.abs(np.linalg.eigvals(loop.closed(stiffness, damping, smoothing))).max(axis=1)


def _limit(bench: Setup, plant: Plant, damping: float) -> TrueLimit:
    """The limit of a plant that does not change: scanned from below, then bisected."""
    fine = sampled_loop(plant, bench.period_s)
    coarse = fine
    if plant.delayed and min(spring.delay_s for spring in plant.delayed) >= bench.period_s:
        coarse = sampled_loop(plant, bench.period_s, COARSE)
    values = bench.values
    top = 40 * values["m" if "m" in values else "m1"] / bench.period_s**2
    # Above, too: a mass of milligrams in syrup is an integrator, with a limit of some 2 b/T.
    decades = np.linspace(-SCAN_DECADES, SCAN_DECADES, 2 * SCAN_POINTS - 1)
    stiffness = top * 10.0**decades
    first = _first_unstable(coarse, stiffness, damping)
    if first is None:
        raise InputError(
            f"no edge of stability up to {stiffness[-1]:g}: the bench's masses are too light for "
            "its dampers; give others"
        )
    if first == 0:
        return TrueLimit(0.0, 0.0)
    # A step to either side, because the coarse chain may be off by a little.
    low, high = stiffness[max(first - 2, 0)], stiffness[min(first + 1, len(stiffness) - 1)]

    def excess(value: float) -> float:
        return float(_radii(fine, np.array([value]), damping)[0]) - 1

    if not excess(low) < 0 < excess(high):
        raise InputError(
            f"no edge of stability between {low:g} and {high:g}; the bench is unstable by itself"
        )
    edge = float(scipy.optimize.brentq(excess, low, high, xtol=1e-11 * high, rtol=1e-13))
    eigenvalues = np.linalg.eigvals(fine.closed(np.array([edge]), damping)[0])
    angle = abs(np.angle(eigenvalues[np.argmax(np.abs(eigenvalues))]))
    return TrueLimit(edge, float(angle / (2 * np.pi * bench.period_s)))


def _first_unstable(loop: SampledLoop, stiffness: Array, damping: float) -> int | None:
    """Index of the first stiffness with an eigenvalue outside the circle, by parts from below."""
    for begin in range(0, len(stiffness), 50):
        unstable = _radii(loop, stiffness[begin : begin + 50], damping) > 1 + 1e-10
        if unstable.any():
            return begin + int(np.argmax(unstable))
    return None
