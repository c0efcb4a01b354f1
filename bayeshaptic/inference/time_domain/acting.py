"""The forces that act on one mass besides its viscous damping, by the laws of the table."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import Law, numbers_of
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.models import Model, rigid
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Acting:
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
        strengths = dict(zip(map(id, self.others), self.strengths, strict=True))
        return np.array(
            [
                strengths[id(effect)] if name == effect.strength[0] else effect.shape[name]
                for effect, name in self.names
            ],
            dtype=np.float64,
        )

    @property
    def most(self) -> Floats:
        """Above which no further number may go."""
        return np.array([effect.most.get(name, np.inf) for effect, name in self.names])

    def at(self, values: Floats) -> Acting:
        """With other numbers to begin with."""
        found = {
            (id(effect), name): v for (effect, name), v in zip(self.names, values, strict=True)
        }

        def moved(effect: NonlinearEffect) -> NonlinearEffect:
            shape = {name: float(found[id(effect), name]) for name in effect.tuned}
            return replace(effect, shape={**effect.shape, **shape})

        strengths = tuple(float(found[id(e), e.strength[0]]) for e in self.others)
        return Acting(moved(self.friction), tuple(map(moved, self.others)), strengths)

    def laws(self, dry: float, values: Floats) -> list[Law]:
        """With dry friction of strength `dry`, and values of the further numbers."""
        rest = iter(values.tolist())
        shape = {name: next(rest) for name in self.friction.tuned}
        found = [_law(self.friction, dry, shape)]
        for effect in self.others:
            strength = next(rest)
            found.append(_law(effect, strength, {name: next(rest) for name in effect.tuned}))
        return found


COULOMB = Acting()


def _law(effect: NonlinearEffect, strength: float, shape: dict[str, float]) -> Law:
    whole = replace(effect, shape={**effect.shape, **shape})
    return whole.law(strength, _mass(), np.zeros(0))


@cache
def _mass() -> Model:
    """One mass: laws of it do not ask for more."""
    return rigid()


def followed(
    values: Floats,
    laws: Sequence[Law],
    forward: Floats,
    backward: Floats,
    command: Floats,
    measured: Floats,
    above: Floats,
    below: Floats,
    period_s: float,
) -> Floats:
    """The simulated position at the samples, as `kernels.follow` has it."""
    from numba import NumbaExperimentalFeatureWarning

    from bayeshaptic.compiled import callback
    from bayeshaptic.inference.time_domain.kernels import follow

    forces = tuple(callback(law.force) for law in laws)
    sticks = np.array([law.sticks for law in laws])
    signals = forward, backward, command, measured, above, below
    with warnings.catch_warnings():  # numba calls tuples of functions an experiment
        warnings.simplefilter("ignore", NumbaExperimentalFeatureWarning)
        return follow(values, *signals, period_s, forces, sticks, *numbers_of(laws))
