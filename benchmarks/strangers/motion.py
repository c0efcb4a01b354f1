"""The motion of a stranger's device in small steps, and what a logger makes of it."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEPS = 8  # a sample


@dataclass(frozen=True)
class Forces:
    """What pushes besides the command; zero is none.

    Dry friction at the motor, more by `sticking` at rest, and e times more every 1/`tighter` of the
    way; in the transmission a cubic spring and a gap in the linear one; quadratic and cubic drag on
    the body; cogging (as a force) and ripple (as a share of the command) over the motor's position;
    a command that is compressed as tanh; a cubic spring from the motor to the ground.
    """

    friction: float = 0.0
    sticking: float = 1.0
    stribeck_speed: float = 1.0
    cubic: float = 0.0
    gap: float = 0.0
    spring: float = 0.0
    drag: float = 0.0
    cogging: float = 0.0
    cogs: float = 0.0
    ripple: float = 0.0
    ripples: float = 0.0
    compressed: float = 0.0
    tighter: float = 0.0
    cubed: float = 0.0
    grounded: float = 0.0


@dataclass(frozen=True)
class Law:
    """A controller at the samples: gains of position, its rate and its sum, of the counts it reads.

    The rate keeps the share `keep` of itself; the command is cut off at `most`.
    """

    spring: float
    damper: float
    integral: float
    keep: float
    most: float
    count: float


@dataclass(frozen=True)
class Motion:
    """A device over one step: transitions that follow each other every so many samples.

    `force` is the input of the command, `inner` that of forces on the masses of the row.
    """

    transitions: Array
    every: int
    force: Array
    inner: Array
    position: Array
    delay_steps: int

    def under(
        self, command: Array, hand: Array, forces: Forces, law: Law | None = None
    ) -> Array | None:
        """The position at the samples; none where it runs away.

        With a law `command` holds what it follows, and then what it commanded.
        """
        numbers = np.array(astuple(forces))
        made = _run(
            np.ascontiguousarray(self.transitions),
            self.every,
            np.ascontiguousarray(self.force),
            np.ascontiguousarray(self.inner),
            self.position,
            self.delay_steps,
            command,
            hand,
            numbers,
            np.array(astuple(law)) if law else np.zeros(0),
        )
        return made if len(made) == len(command) else None


@njit(cache=True)
def _rubbed(begins, ends, inverse, most):  # type: ignore[no-untyped-def]
    """Dry friction in the mean of a step; without it a mass begins and ends at these velocities."""
    way = np.sign(begins) if begins != 0 else np.sign(ends)
    if way * ends >= most * inverse:  # it slides on
        return -way * most
    pulled = abs(ends - begins)
    if pulled <= most * inverse:  # it comes to rest
        return -ends / inverse
    # It turns, and slides back for the rest of the step.
    back = 1 - abs(begins) / (pulled + most * inverse)
    return (-way * back * (pulled - most * inverse) - ends) / inverse


@njit(cache=True)
def _run(transitions, every, entry, entries, position, late, command, hand, numbers, law):  # type: ignore[no-untyped-def]
    friction, sticking, slow, cubic, gap, spring, drag = numbers[:7]
    cogging, cogs, ripple, ripples, compressed, tighter, cubed, grounded = numbers[7:]
    samples, row = len(command), entries.shape[1]
    state, found, inner = np.zeros(len(entry)), np.zeros(samples), np.zeros(row)
    rate, total, last = 0.0, 0.0, 0.0
    for k in range(samples):
        found[k] = position @ state
        if len(law):
            read = law[5] * np.round(found[k] / law[5])
            rate = law[3] * rate + (1 - law[3]) * (read - last)
            last = read
            total += command[k] - read
            push = law[0] * (command[k] - read) - law[1] * rate + law[2] * total
            command[k] = max(-law[4], min(law[4], push))
        transition = transitions[min(k // every, len(transitions) - 1)]
        for step in range(STEPS):
            begun = k * STEPS + step - late  # the command of this step
            force = command[begun // STEPS] if begun >= 0 else 0.0
            if compressed > 0:
                force = np.tanh(force * compressed) / compressed
            force *= 1 + ripple * np.sin(ripples * state[0])
            free = transition @ state + entry * force
            ahead = free
            # Inner forces are those in the middle of the step: at its beginning they would be late,
            # and a gap of a stiff spring late by 60 us damps as much again as the transmission.
            for _ in range(3):  # the middle is where these forces take it
                middle = 0.5 * (state + ahead)
                inner[:] = 0.0
                if row > 1:
                    stretch = middle[0] - middle[1]
                    pull = spring * (cubic * stretch**3 - max(-gap, min(gap, stretch)))
                    inner[0] -= pull
                    inner[1] += pull
                body = min(row - 1, 1)
                speed = middle[row + body]
                inner[body] -= (drag * abs(speed) + cubed * speed**2) * speed
                inner[0] += cogging * np.sin(cogs * middle[0]) - grounded * middle[0] ** 3
                inner[-1] += hand[k]
                ahead = free + entries @ inner
                if friction > 0:
                    most = friction * (1 + (sticking - 1) * np.exp(-((middle[row] / slow) ** 2)))
                    most *= np.exp(tighter * state[0])
                    rubbed = _rubbed(state[row], ahead[row], entries[row, 0], most)
                    ahead = ahead + entries[:, 0] * rubbed
            state = ahead
        if not abs(state[0]) < 1e6:
            return found[:k]
    return found
