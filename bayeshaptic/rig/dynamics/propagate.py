"""Exact propagation of a plant over one sampling period, for a force that is held and delayed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg

from bayeshaptic.rig.dynamics.plant import Array, Plant


@dataclass(frozen=True)
class StateLayout:
    """Where the inputs stand behind the states in the augmented state of the propagator.

    Every input is a state of its own: the command and the nonlinear forces keep their values during
    a step, the hand's force and the delayed springs' forces run along straight lines.  Properties
    are indices into that state.

    Attributes
    ----------
    states, laws, delayed : int
        How many states, nonlinear forces and delayed springs the plant has.
    """

    states: int
    laws: int
    delayed: int

    @property
    def command(self) -> int:
        return self.states

    @property
    def hand(self) -> int:
        return self.states + 1

    @property
    def hand_slope(self) -> int:
        return self.states + 2

    @property
    def first_law(self) -> int:
        return self.states + 3

    @property
    def first_delayed(self) -> int:
        return self.first_law + self.laws

    @property
    def first_slope(self) -> int:
        return self.first_delayed + self.delayed

    @property
    def size(self) -> int:
        """Length of the augmented state."""
        return self.first_slope + self.delayed


def layout(plant: Plant) -> StateLayout:
    """Where a plant's inputs stand in its augmented state."""
    return StateLayout(plant.states, len(plant.laws), len(plant.delayed))


def generator(plant: Plant) -> Array:
    """The matrix whose exponential advances states and inputs together.

    Parameters
    ----------
    plant : Plant

    Returns
    -------
    ndarray, shape (size, size)
        Times a step's length its exponential is that step (C. F. Van Loan, "Computing integrals
        involving the matrix exponential", IEEE Transactions on Automatic Control 23, 1978).
    """
    at, n = layout(plant), plant.states
    matrix = np.zeros((at.size, at.size))
    matrix[:n, :n] = plant.dynamics
    matrix[:n, at.command] = plant.motor
    matrix[:n, at.hand] = plant.hand
    matrix[at.hand, at.hand_slope] = 1.0
    matrix[:n, at.first_law : at.first_delayed] = plant.law_columns
    matrix[:n, at.first_delayed : at.first_slope] = plant.delayed_columns
    for j in range(at.delayed):
        matrix[at.first_delayed + j, at.first_slope + j] = 1.0
    return matrix


def split_delay(delay_s: float, period_s: float) -> tuple[int, float]:
    """A delay as whole periods and a rest, s, 0 <= rest < period_s; rounding apart."""
    periods = delay_s / period_s
    whole = math.floor(periods + 1e-9)
    rest = (periods - whole) * period_s
    return whole, rest if rest > 1e-9 * period_s else 0.0


@dataclass(frozen=True)
class Stretch:
    """A part of the period in which the command is constant, cut into equal steps.

    Attributes
    ----------
    length_s : float
    steps : int
    new : bool
        Whether the new command acts in it, or still the one before.
    """

    length_s: float
    steps: int
    new: bool

    @property
    def step_s(self) -> float:
        """Length of a step, s."""
        return self.length_s / self.steps


def stretches(delay_s: float, period_s: float, substeps: int) -> tuple[Stretch, ...]:
    """The period, cut where the delayed command changes.

    Until the rest of the delay has passed the previous command still acts, afterwards the new one;
    the steps are no longer than period_s/substeps.
    """
    _, rest = split_delay(delay_s, period_s)
    parts = ((rest, False), (period_s - rest, True))
    return tuple(
        Stretch(length, max(1, math.ceil(length / period_s * substeps - 1e-9)), new)
        for length, new in parts
        if length > 0
    )


@dataclass(frozen=True)
class PeriodMap:
    """x[k+1] = phi x[k] + old u[k-d-1] + new u[k-d] + hand_start h[k] + hand_end h[k+1].

    Attributes
    ----------
    phi : ndarray, shape (n, n)
    old, new : ndarray, shape (n,)
        What the command before and the new one do, of which the latter acts when the rest of the
        delay has passed.
    hand_start, hand_end : ndarray, shape (n,)
        What the hand's force h does, a straight line between samples.
    delay_periods : int
        d, the whole part of the delay.
    """

    phi: Array
    old: Array
    new: Array
    hand_start: Array
    hand_end: Array
    delay_periods: int


def period_map(plant: Plant, period_s: float) -> PeriodMap:
    """One sampling period of a plant's linear part, by matrix exponentials.

    Nonlinear forces and delayed springs are left out.
    """
    at, n, matrix = layout(plant), plant.states, generator(plant)
    whole, rest = split_delay(plant.delay_s, period_s)
    first = scipy.linalg.expm(matrix * rest)
    second = scipy.linalg.expm(matrix * (period_s - rest))
    whole_period = second @ first
    hand_value, hand_slope = whole_period[:n, at.hand], whole_period[:n, at.hand_slope]
    return PeriodMap(
        phi=whole_period[:n, :n],
        old=second[:n, :n] @ first[:n, at.command],
        new=second[:n, at.command],
        hand_start=hand_value - hand_slope / period_s,
        hand_end=hand_slope / period_s,
        delay_periods=whole,
    )


def shifted(command: Array, periods: int, before: Array) -> Array:
    """A command that arrives later.

    Parameters
    ----------
    command : ndarray, shape (N,)
    periods : int
        By how many samples.
    before : ndarray, shape (M,)
        What was commanded before; zeros where that does not reach back far enough.

    Returns
    -------
    ndarray, shape (N,)
    """
    history = np.concatenate([np.zeros(max(periods - len(before), 0)), before, command])
    start = len(history) - len(command) - periods
    return history[start : start + len(command)]


def recur(phi: Array, drive: Array) -> Array:
    """x[k] = phi x[k-1] + drive[k] for all k, x[0] = drive[0], by recursive doubling.

    Parameters
    ----------
    phi : ndarray, shape (n, n)
    drive : ndarray, shape (N, n)

    Returns
    -------
    ndarray, shape (N, n)
        After the pass with shift s, x[k] holds the last 2 s terms of its sum; log2(N) matrix
        products do the work of N steps.
    """
    x, power, shift = drive.copy(), phi, 1
    while shift < len(x):
        x[shift:] += x[:-shift] @ power.T
        power = power @ power
        shift *= 2
    return x


def run_linear(
    period: PeriodMap, start: Array, command: Array, before: Array, hand: Array
) -> Array:
    """States at the N sample instants and one period after the last, shape (N + 1, n).

    Parameters
    ----------
    period : PeriodMap
    start : ndarray, shape (n,)
        State at the first instant.
    command : ndarray, shape (N,)
    before : ndarray
        The commands in front of the first, as many as are known.
    hand : ndarray, shape (N + 1,)
    """
    d = period.delay_periods
    drive = np.empty((len(command) + 1, len(start)))
    drive[0] = start
    drive[1:] = (
        np.outer(shifted(command, d + 1, before), period.old)
        + np.outer(shifted(command, d, before), period.new)
        + np.outer(hand[:-1], period.hand_start)
        + np.outer(hand[1:], period.hand_end)
    )
    return recur(period.phi, drive)
