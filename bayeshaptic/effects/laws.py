"""The table of laws: what the effects of internal forces and actuators offer, by what needs it."""

from __future__ import annotations

from collections.abc import Iterable

from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import Shape, Usual


def tested() -> dict[str, Shape]:
    """The shapes that the residual is tested for, by name."""
    return {shape.name: shape for kind in effects("nonlinear") for shape in kind.tests}


BESIDE = " beside"
"""Behind a variable, the name of a test for another force over it beside those that were found."""


def variables(raised: Iterable[str]) -> set[str]:
    """What raised tests are over; tests that are of no shape stay as they are."""
    shapes = tested()
    names = (name.removesuffix(BESIDE) for name in raised)
    return {shapes[name].over if name in shapes else name for name in names}


def fitted(place: Place, usual: Usual) -> list[tuple[str, Shape]]:
    """Names of laws at a place, and shapes to fit."""
    return [(kind.name, s) for kind in effects("nonlinear") for s in kind.shapes(place, usual)]


def corrections(usual: Usual) -> list[Shape]:
    """What laws add to simpler ones of the same thing, at the motor."""
    return [shape for kind in effects("nonlinear") for shape in kind.corrections(usual)]


def simplest(effect: NonlinearEffect) -> NonlinearEffect | None:
    """The simplest law of an effect's strength, at its place, where it contains one."""
    kinds = (kind for kind in effects("nonlinear") if kind.strength == effect.strength)
    laws = (kind(effect.place) for kind in kinds if not kind.dimensions)
    return next((law for law in laws if effect.contains(law)), None)
