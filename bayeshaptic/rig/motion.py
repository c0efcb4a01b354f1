"""The motion of a bench under a given command, in parts where the mechanism changes with time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.bench import Bench
from bayeshaptic.rig.dynamics.plant import Array, Plant
from bayeshaptic.rig.dynamics.propagate import period_map, run_linear, split_delay
from bayeshaptic.rig.dynamics.stepper import Stepper

# A mechanism that changes does so in this many small jumps.
EPOCHS = 100

Start = Mapping[str, tuple[float, float]]


@dataclass(frozen=True)
class Epoch:
    """Samples `first` up to but without `stop`, in which the plant stays the same."""

    first: int
    stop: int
    plant: Plant


def epochs(bench: Bench, progress: Array) -> list[Epoch]:
    """The run as epochs of one plant each.

    Parameters
    ----------
    bench : Bench
    progress : ndarray, shape (N,)
        Part of the recording that is over at each sample.
    """
    count = len(progress)
    if not bench.varies:
        return [Epoch(0, count, bench.plant())]
    edges = np.unique(np.linspace(0, count, EPOCHS + 1).round().astype(int)).tolist()
    return [
        Epoch(a, b, bench.plant(float(progress[(a + b) // 2])))
        for a, b in zip(edges[:-1], edges[1:], strict=True)
    ]


def initial_state(plant: Plant, start: Start | None) -> Array:
    """The state in which the masses move as told, and all else is at rest.

    Parameters
    ----------
    plant : Plant
    start : mapping of str to (position, velocity), or None
        By the names of the masses.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    InputError
        For a mass that the bench does not have.
    """
    state = np.zeros(plant.states)
    for node, motion in (start or {}).items():
        if node not in plant.places:
            raise InputError(f"the bench has no mass '{node}'; it has {', '.join(plant.places)}")
        state[list(plant.places[node])] = motion
    return state


def respond(
    bench: Bench,
    force: Array,
    hand: Array,
    progress: Array,
    start: Start | None,
    substeps: int,
    halvings: int,
) -> tuple[Array, Array]:
    """Position and velocity in front of the encoder at each of N samples.

    Parameters
    ----------
    bench : Bench
    force : ndarray, shape (N,)
        What the actuator is told, N or N m.
    hand : ndarray, shape (N + 1,)
        Force of the hand, at the samples and at the end.
    progress : ndarray, shape (N,)
    start, substeps, halvings
        As in `simulate`.

    Returns
    -------
    position, velocity : ndarray, shape (N,)
    """
    parts = epochs(bench, progress)
    plant = parts[0].plant
    state = initial_state(plant, start)
    if plant.laws or plant.delayed:
        stepper = Stepper(plant, bench.period_s, substeps, halvings)
        stepper.start(state)
        states = _step_through(stepper, parts, force, hand)
    else:
        states = np.empty((len(force), plant.states))
        for epoch in parts:
            period = period_map(epoch.plant, bench.period_s)
            a, b = epoch.first, epoch.stop
            found = run_linear(period, state, force[a:b], force[:a], hand[a : b + 1])
            states[a:b], state = found[:-1], found[-1]
    return states @ plant.position, states @ plant.velocity


def _step_through(stepper: Stepper, parts: list[Epoch], force: Array, hand: Array) -> Array:
    """States at every sample, shape (N, n), by time steps."""
    whole, _ = split_delay(stepper.plant.delay_s, stepper.period_s)
    acting = np.concatenate([np.zeros(whole + 1), force])
    states = []
    for epoch in parts:
        if epoch.first:
            stepper.retune(epoch.plant)
        own = slice(epoch.first, epoch.stop + 1)
        states.append(stepper.run(acting[own], hand[own]))
    return np.concatenate(states)
