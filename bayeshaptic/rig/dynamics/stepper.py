"""Time steps with nonlinear forces and delayed springs: exact where linear, sticking exactly."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from bayeshaptic.compiled import callback
from bayeshaptic.rig.dynamics.laws import DryFriction, SmoothLaw
from bayeshaptic.rig.dynamics.plant import Array, Plant
from bayeshaptic.rig.dynamics.propagate import layout
from bayeshaptic.rig.dynamics.step_tables import Memory, tables

SUBSTEPS = 8
HALVINGS = 6


def _run_compiled(*arguments: Any) -> None:
    """`stepper_kernel.run`, imported when it is first needed."""
    from numba import NumbaExperimentalFeatureWarning

    from bayeshaptic.rig.dynamics.stepper_kernel import run

    with warnings.catch_warnings():  # numba calls tuples of functions an experiment
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        run(*arguments)


def _no_force(q: float, v: float, before: float, dq: float, constants: Array) -> float:
    """In the place of dry friction, whose force the stepper finds."""
    return 0.0


class Stepper:
    """A plant in time: set the inputs of a period, take it, read the position.

    A step of the linear part is a matrix exponential. Smooth laws are predicted with their force at
    the beginning of the step and corrected by the ramp to their force at its end (second order,
    Cox and Matthews, J. Comput. Phys. 176, 2002). Dry friction slides with a constant force while
    the velocity keeps its sign; a step in which it does not is halved, `halvings` times at most. At
    the bottom the force is the one that brings the velocity to exactly zero, or, where friction
    cannot hold against the other forces, the mean of the old direction's and the new one's. A stuck
    mass does not move at all.

    Parameters
    ----------
    plant : Plant
    period_s : float
    substeps : int
        Steps a period, at least; one where there is nothing but linear dynamics.
    halvings : int
        How often a step may be halved to find where friction reverses.
    """

    def __init__(
        self,
        plant: Plant,
        period_s: float,
        substeps: int = SUBSTEPS,
        halvings: int = HALVINGS,
    ) -> None:
        self.period_s = period_s
        self.substeps = substeps if plant.laws or plant.delayed else 1
        self.halvings = halvings if any(law.dry for law in plant.laws) else 0
        self.retune(plant)
        springs = len(plant.delayed)
        self.memory = Memory(
            np.zeros(layout(plant).size),
            np.zeros(len(plant.laws), int),
            np.zeros((springs, 1)),
            np.array([1 if springs else 0]),
        )

    def retune(self, plant: Plant) -> None:
        """Go on with another plant of the same layout: positions and velocities stay."""
        self.plant = plant
        self.tables = tables(plant, self.period_s, self.substeps, self.halvings)
        smooth = [law.force if isinstance(law, SmoothLaw) else _no_force for law in plant.laws]
        self._forces = tuple(map(callback, smooth or [_no_force]))

    def start(self, state: Array) -> None:
        """Begin with a mechanical state, shape (n,)."""
        z, first = self.memory.z, layout(self.plant).first_law
        z[: self.plant.states] = state
        for j, (law, motion) in enumerate(zip(self.plant.laws, self.plant.law_motion, strict=True)):
            q, v = motion @ state
            if isinstance(law, SmoothLaw):
                z[first + j] = law.force(q, v, 0.0, 0.0, law.constants)
            elif isinstance(law, DryFriction):
                self.memory.mode[j] = np.sign(v)
                z[first + j] = -np.sign(v) * law.bound(v)
        self.memory.history[:, :1] = (self.plant.delayed_signals @ state)[:, None]

    @property
    def state(self) -> Array:
        """The plant's state, shape (n,)."""
        return self.memory.z[: self.plant.states]

    def advance(self, old: float, new: float, hand: float, hand_next: float) -> None:
        """Take one period.

        Parameters
        ----------
        old, new : float
            Command that acts until the rest of the delay has passed, and afterwards.
        hand, hand_next : float
            Hand force at the beginning and the end of the period.
        """
        self.run(np.array([old, new]), np.array([hand, hand_next]))

    def run(self, acting: Array, hand: Array) -> Array:
        """Take periods.

        Parameters
        ----------
        acting : ndarray, shape (N + 1,)
            Commands: the one of a period follows that of the period before when the rest of the
            delay has passed.
        hand : ndarray, shape (N + 1,)
            Hand force at the ends of the periods.

        Returns
        -------
        ndarray, shape (N, n)
            The state at the beginning of each.
        """
        states = np.empty((len(acting) - 1, self.plant.states))
        self._make_room(len(states) * int(self.tables.steps.sum()))
        acting, hand = np.ascontiguousarray(acting), np.ascontiguousarray(hand)
        _run_compiled(self.tables, self._forces, self.memory, acting, hand, states)
        return states

    def _make_room(self, steps: int) -> None:
        """Room for the signals of the delayed springs over so many steps more."""
        history = self.memory.history
        if len(history) and self.memory.filled[0] + steps > history.shape[1]:
            room = np.zeros((len(history), history.shape[1] + steps))
            grown = np.concatenate([history, room], axis=1)
            self.memory = self.memory._replace(history=grown)
