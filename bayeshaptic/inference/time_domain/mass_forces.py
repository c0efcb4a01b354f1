"""The forces that act on one mass besides its viscous damping, by the laws of the table."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import Law, numbers_of
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.models import Model, rigid
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class MassForces:
    """Dry friction by one law, and further forces, with their numbers to begin with.

    Attributes
    ----------
    friction : NonlinearEffect
        Its strength is the mass's dry friction, a parameter of its own.
    others : tuple of NonlinearEffect
    strengths : tuple of float
        Of the others.
    """

    friction: NonlinearEffect = CoulombFriction()
    others: tuple[NonlinearEffect, ...] = ()
    strengths: tuple[float, ...] = ()

    @property
    def names(self) -> tuple[tuple[NonlinearEffect, str], ...]:
        """Further numbers: whose they are, and what they are called there."""
        found = [(self.friction, name) for name in self.friction.tuned]
        for effect in self.others:
            found += [(effect, name) for name in (effect.strength[0], *effect.tuned)]
        return tuple(found)

    @property
    def start(self) -> Floats:
        """Values of these to begin with."""
        found = [self.friction.shape[name] for name in self.friction.tuned]
        for effect, strength in zip(self.others, self.strengths, strict=True):
            found += [strength, *(effect.shape[name] for name in effect.tuned)]
        return np.array(found, dtype=np.float64)

    @property
    def most(self) -> Floats:
        """Above which no further number may go."""
        return np.array([effect.most.get(name, np.inf) for effect, name in self.names])

    def at(self, values: Floats) -> MassForces:
        """With other numbers to begin with."""
        rest = iter(values.tolist())
        friction = _shaped(self.friction, rest)
        others, strengths = [], []
        for effect in self.others:
            strengths.append(next(rest))
            others.append(_shaped(effect, rest))
        return MassForces(friction, tuple(others), tuple(strengths))

    def laws(self, dry: float, values: Floats) -> list[Law]:
        """With dry friction of strength `dry`, and values of the further numbers."""
        acting = self.at(values)
        found = [acting.friction.law(dry, _mass(), np.zeros(0))]
        for effect, strength in zip(acting.others, acting.strengths, strict=True):
            found.append(effect.law(strength, _mass(), np.zeros(0)))
        return found


COULOMB = MassForces()


def _shaped(effect: NonlinearEffect, numbers: Iterator[float]) -> NonlinearEffect:
    """With the next of these numbers for its shape."""
    shape = {name: next(numbers) for name in effect.tuned}
    return replace(effect, shape={**effect.shape, **shape}) if shape else effect


@cache
def _mass() -> Model:
    """One mass: laws of it do not ask for more."""
    return rigid()


def simulate(
    values: Floats,
    laws: Sequence[Law],
    forward: Floats,
    backward: Floats,
    command: Floats,
    measured: Floats,
    follower: Follower,
    period_s: float,
) -> Floats:
    """The simulated position at the samples, as `kernels.follow` has it."""
    from numba import NumbaExperimentalFeatureWarning

    from bayeshaptic.compiled import callback
    from bayeshaptic.inference.time_domain.kernels import follow

    forces = tuple(callback(law.force) for law in laws)
    sticks = np.array([law.sticks for law in laws])
    signals = forward, backward, command, measured, follower.above, follower.below
    with warnings.catch_warnings():  # numba calls tuples of functions an experiment
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        return follow(values, *signals, period_s, forces, sticks, *numbers_of(laws))
