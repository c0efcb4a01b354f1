"""A structure as linear state equations, with the ports that everything else acts through."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.rig.dynamics.laws import Law
from bayeshaptic.rig.dynamics.structure import FRAME, GROUND, DelayedSpring, Relaxation, Structure

Array: TypeAlias = NDArray[Any]


@dataclass(frozen=True)
class Plant:
    """The state equations x' = dynamics x + ports, n states of which the first 2 N are mechanical.

    Attributes
    ----------
    dynamics : ndarray, shape (n, n)
    motor, hand : ndarray, shape (n,)
        What a unit of (delayed) command and of hand force does; `hand` is zero without a hand.
    position, velocity : ndarray, shape (n,)
        What the encoder sees, behind the position filters, and its derivative.
    law_columns : ndarray, shape (n, L)
        What a unit of each nonlinear force does.
    law_motion : ndarray, shape (L, 2, n)
        Relative position and velocity that each nonlinear force depends on.
    delayed_columns, delayed_signals : ndarray, shapes (n, D) and (D, n)
        The same for delayed springs: where they push, and the signal that comes back delayed.
    places : dict of str to tuple of int
        Where the position and the velocity of each mass are in the state.
    delay_s : float
        Loop delay in front of the actuator, s.
    """

    dynamics: Array
    motor: Array
    hand: Array
    position: Array
    velocity: Array
    laws: tuple[Law, ...]
    law_columns: Array
    law_motion: Array
    delayed: tuple[DelayedSpring, ...]
    delayed_columns: Array
    delayed_signals: Array
    places: dict[str, tuple[int, int]]
    delay_s: float

    @property
    def states(self) -> int:
        """n, the number of states."""
        return len(self.dynamics)


def assemble(structure: Structure) -> Plant:
    """The state equations of a structure.

    The state is: positions, velocities, force of each relaxation, actuator stages, position
    filters, low-passed signals of the delayed springs.

    Raises
    ------
    InputError
        Where something acts on a mass that the structure does not have.
    """
    return _Assembly(structure).plant()


class _Assembly:
    """Where each part of the structure stands in the state."""

    def __init__(self, structure: Structure) -> None:
        self.structure = structure
        self.nodes = list(structure.masses)
        self.count = len(self.nodes)
        filtered = sum(1 if damping is None else 2 for _, damping in structure.filters)
        lowpassed = sum(spring.time_constant_s > 0 for spring in structure.delayed)
        extra = len(structure.relaxations) + len(structure.lags_s) + filtered + lowpassed
        self.n = 2 * self.count + extra
        self.next_free = 2 * self.count
        self.a = np.zeros((self.n, self.n))
        self.a[: self.count, self.count : 2 * self.count] = np.eye(self.count)
        self.inverse_mass = 1 / np.array(list(structure.masses.values()))

    def plant(self) -> Plant:
        structure, count = self.structure, self.count
        for link in structure.links:
            x, v = self._motion(link.a, link.b)
            self.a -= np.outer(self._push(link.a, link.b), link.stiffness * x + link.damping * v)
        for relaxation in structure.relaxations:
            self._add_relaxation(relaxation)
        motor = self._motor()
        position = self._sensor()
        signals = [self._delayed_signal(spring) for spring in structure.delayed]
        hand = self._push(structure.hand, GROUND) if structure.hand else np.zeros(self.n)
        return Plant(
            dynamics=self.a,
            motor=motor,
            hand=hand,
            position=position,
            velocity=position @ self.a,
            laws=tuple(entry.law for entry in structure.laws),
            law_columns=self._columns([self._push(e.a, e.b) for e in structure.laws]),
            law_motion=np.array([self._motion(e.a, e.b) for e in structure.laws]).reshape(
                -1, 2, self.n
            ),
            delayed=tuple(structure.delayed),
            delayed_columns=self._columns([-self._push(s.a, s.b) for s in structure.delayed]),
            delayed_signals=np.array(signals).reshape(-1, self.n),
            places={node: (i, count + i) for i, node in enumerate(self.nodes)},
            delay_s=structure.delay_s,
        )

    def _incidence(self, a: str, b: str) -> Array:
        """+1 at the mass a, -1 at the mass b; the ground, and a frame without mass, have none."""
        incidence = np.zeros(self.count)
        for node, sign in ((a, 1.0), (b, -1.0)):
            if node in self.nodes:
                incidence[self.nodes.index(node)] = sign
            elif node not in (GROUND, FRAME):
                self.structure.check(node)
        return incidence

    def _push(self, a: str, b: str) -> Array:
        """What a unit force on a, and its reaction on b, do to the state."""
        column = np.zeros(self.n)
        column[self.count : 2 * self.count] = self.inverse_mass * self._incidence(a, b)
        return column

    def _motion(self, a: str, b: str) -> tuple[Array, Array]:
        """Rows that read the position and the velocity of a relative to b."""
        x, v = np.zeros(self.n), np.zeros(self.n)
        x[: self.count] = v[self.count : 2 * self.count] = self._incidence(a, b)
        return x, v

    def _columns(self, columns: list[Array]) -> Array:
        return np.array(columns).reshape(-1, self.n).T

    def _take(self, states: int) -> int:
        """Room for more states; the index of the first."""
        first = self.next_free
        self.next_free += states
        return first

    def _add_relaxation(self, element: Relaxation) -> None:
        """F' = stiffness v - F / time constant, and F between both nodes."""
        _, v = self._motion(element.a, element.b)
        state = self._take(1)
        self.a[state] += element.stiffness * v
        self.a[state, state] -= 1 / element.time_constant_s
        self.a[:, state] -= self._push(element.a, element.b)

    def _motor(self) -> Array:
        """The column of the command: the actuator's first stage, or the motor itself."""
        column = self._push(self.structure.motor, FRAME)
        for time_constant in reversed(self.structure.lags_s):
            state = self._take(1)
            self.a[:, state] += column
            self.a[state, state] -= 1 / time_constant
            column = np.zeros(self.n)
            column[state] = 1 / time_constant
        return column

    def _sensor(self) -> Array:
        """The row of the encoder: the motor's position, or the last filter."""
        row, _ = self._motion(self.structure.motor, FRAME)
        for cutoff, damping in self.structure.filters:
            state = self._take(1 if damping is None else 2)
            if damping is None:
                self.a[state] += cutoff * row
                self.a[state, state] -= cutoff
            else:
                self.a[state, state + 1] = 1.0
                self.a[state + 1] += cutoff**2 * row
                self.a[state + 1, state] -= cutoff**2
                self.a[state + 1, state + 1] -= 2 * damping * cutoff
            row = np.zeros(self.n)
            row[state] = 1.0
        return row

    def _delayed_signal(self, spring: DelayedSpring) -> Array:
        """The row of the force, as if there were no delay."""
        x, v = self._motion(spring.a, spring.b)
        row = spring.stiffness * x + spring.damping * v
        if spring.time_constant_s > 0:
            state = self._take(1)
            self.a[state] += row / spring.time_constant_s
            self.a[state, state] -= 1 / spring.time_constant_s
            row = np.zeros(self.n)
            row[state] = 1.0
        return row
