"""The linear part of a stranger's device, in states; no code in common with the package.

Masses in a row, from the motor outward, with whatever is hung on them, a base that gives, an
amplifier before and a filter behind; K_CR by the eigenvalues of the sampled loop.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

Array = NDArray[np.float64]

# Of eigenvalues: a slow device leaves the unit circle so slowly with the stiffness that 1e-8 more
# was up to 0.7 % of its limit.
_EXACT = 1e-12


@dataclass(frozen=True)
class States:
    """x' = a x + b f + g forces on the masses, position = c x.

    The first 2 n states are the positions and then the velocities of the n masses.
    """

    a: Array
    b: Array
    c: Array
    g: Array

    def held(self, step_s: float) -> tuple[Array, Array, Array]:
        """Transition, and input of the force and of the forces on the masses, over one step."""
        inputs = np.column_stack([self.b, self.g])
        size, count = inputs.shape
        block = np.zeros((size + count, size + count))
        block[:size, :size], block[:size, size:] = self.a, inputs
        whole = expm(block * step_s)
        return whole[:size, :size], whole[:size, size], whole[:size, size + 1 :]

    def with_drive(self, poles: Array, entry: Array, leaving: Array) -> States:
        """The force through a filter x' = poles x + entry f, force = leaving x."""
        size, count = len(self.a), len(poles)
        a = block_diag(self.a, poles)
        a[:size, size:] = np.outer(self.b, leaving)
        return States(
            a,
            np.concatenate([np.zeros(size), entry]),
            np.pad(self.c, (0, count)),
            np.pad(self.g, ((0, count), (0, 0))),
        )

    def with_sensor(self, corner: float) -> States:
        """The position through a low-pass of first order, corner in rad/s."""
        a = block_diag(self.a, [[-corner]])
        a[-1, :-1] = corner * self.c
        last = np.eye(len(a))[-1]
        return States(a, np.append(self.b, 0.0), last, np.pad(self.g, ((0, 1), (0, 0))))

    def critical_stiffness(self, period_s: float, delay_s: float) -> float:
        """The stiffness from which on the sampled wall is unstable, searched upward."""
        late = int(delay_s / period_s + 1e-9)
        early_s = delay_s - late * period_s
        a, _, _ = self.held(period_s)
        rest, newer, _ = self.held(period_s - early_s)
        older = rest @ self.held(early_s)[1]
        size = len(a)
        loop = np.zeros((size + late + 1, size + late + 1))
        loop[:size, :size] = a
        loop[size + 1 :, size:-1] = np.eye(late)

        def unstable(stiffness: float) -> bool:
            closed, force = loop.copy(), -stiffness * self.c
            closed[size, :size] = force
            for lag, share in ((late, newer), (late + 1, older)):
                if lag == 0:
                    closed[:size, :size] += np.outer(share, force)
                else:
                    closed[:size, size + lag - 1] += share
            return bool(np.abs(np.linalg.eigvals(closed)).max() > 1 + _EXACT)

        grid = np.geomspace(1e-2, 1e7, 900)
        first = next((i for i, value in enumerate(grid) if unstable(value)), None)
        if first is None:
            return np.inf
        low, high = grid[max(first - 1, 0)], grid[first]
        for _ in range(40):
            middle = np.sqrt(low * high)
            low, high = (low, middle) if unstable(middle) else (middle, high)
        return float(low)


class Masses:
    """Masses on springs and dampers, put together link by link; the motor is the first."""

    def __init__(self, masses: list[float]) -> None:
        self.masses, self.row = list(masses), len(masses)
        self.base: int | None = None
        self.links: list[tuple[int, int | None, float, float]] = []
        self.relaxing: list[tuple[int, int | None, float, float]] = []

    def tie(self, one: int, other: int | None, damping: float, stiffness: float) -> None:
        """A damper and a spring to another mass, or to the ground."""
        self.links.append((one, other, damping, stiffness))

    def relax(self, one: int, other: int | None, stiffness: float, time_s: float) -> None:
        """A spring that a damper lets go within a time."""
        self.relaxing.append((one, other, stiffness, time_s))

    def hang(self, on: int | None, mass: float, rad_s: float, ratio: float) -> int:
        """One more mass on its own spring, on another one or on the ground."""
        self.masses.append(mass)
        new = len(self.masses) - 1
        self.tie(new, on, 2 * ratio * mass * rad_s, mass * rad_s**2)
        return new

    def on_a_base(self, mass: float, rad_s: float, ratio: float) -> None:
        """Motor, encoder and the dampers of the row stand on a mass that gives."""
        self.base = self.hang(None, mass, rad_s, ratio)
        self.links = [
            (one, self.base if other is None and one < 2 and not stiffness else other, c, stiffness)
            for one, other, c, stiffness in self.links
        ]

    def states(self) -> States:
        """In states, what was hung on the row behind the row."""
        count = len(self.masses)
        stiff, damp = np.zeros((2, count, count))
        for one, other, damping, stiffness in self.links:
            along = np.zeros(count)
            along[one] = 1.0
            if other is not None:
                along[other] = -1.0
            damp += damping * np.outer(along, along)
            stiff += stiffness * np.outer(along, along)
        inverse = 1 / np.array(self.masses)
        row, rest = np.arange(self.row), np.arange(self.row, count)
        order = np.concatenate([row, count + row, rest, count + rest])
        place = np.argsort(order)  # of position i, and of velocity i at count + i
        a = np.zeros((2 * count, 2 * count))
        a[:count, count:] = np.eye(count)
        a[count:, :count], a[count:, count:] = -inverse[:, None] * stiff, -inverse[:, None] * damp
        a = a[np.ix_(order, order)]
        b, c = np.zeros((2, 2 * count))
        b[place[count]], c[place[0]] = inverse[0], 1.0
        if self.base is not None:
            b[place[count + self.base]], c[place[self.base]] = -inverse[self.base], -1.0
        g = np.zeros((2 * count, self.row))
        g[self.row + row, row] = inverse[row]
        states = States(a, b, c, g)
        for one, other, stiffness, time_s in self.relaxing:
            ends = [(place[count + one], 1.0, inverse[one])]
            if other is not None:
                ends.append((place[count + other], -1.0, inverse[other]))
            states = _relaxing(states, ends, stiffness, time_s)
        return states


def _relaxing(
    states: States, ends: list[tuple[int, float, float]], stiffness: float, time_s: float
) -> States:
    """One more state: the force of a spring that lets go, between velocities."""
    a = block_diag(states.a, [[-1 / time_s]])
    for velocity, sign, inverse in ends:
        a[-1, velocity] += sign * stiffness
        a[velocity, -1] -= sign * inverse
    more = ((0, 1), (0, 0))
    return States(a, np.append(states.b, 0.0), np.append(states.c, 0.0), np.pad(states.g, more))
