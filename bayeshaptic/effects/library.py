"""The library of effects: those of this package, and those that other packages register."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from importlib.metadata import entry_points
from typing import Any

from bayeshaptic.effects import measurement
from bayeshaptic.effects.linear import (
    attached_mass,
    base_compliance,
    centring_stiffness,
    extra_delay,
    low_pass,
    reflex,
    transmission_loss,
)
from bayeshaptic.effects.nonlinear import actuator, drag, friction, gravity, springs
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.effects.registry import register, registered
from bayeshaptic.errors import InputError

ENTRY_POINT = "bayeshaptic.effects"
# Importing an effect registers it.
OWN = (
    attached_mass,
    base_compliance,
    centring_stiffness,
    extra_delay,
    low_pass,
    reflex,
    transmission_loss,
    actuator,
    friction,
    drag,
    springs,
    gravity,
    measurement,
)


@cache
def _load_installed() -> None:
    for point in entry_points(group=ENTRY_POINT):
        register(point.load())


def effects(family: str | None = None) -> tuple[Any, ...]:
    """The effect classes, of one family or all, in the order in which they were registered."""
    _load_installed()
    return tuple(e for e in registered().values() if family is None or e.family == family)


def effect_class(name: str) -> Any:
    """The effect called `name`.

    Raises
    ------
    InputError
        If there is none; the message lists those there are.
    """
    _load_installed()
    known = registered()
    if name not in known:
        raise InputError(f"no effect {name!r}; there are {', '.join(known)}.")
    return known[name]


def force_laws(names: Iterable[str]) -> list[type[NonlinearEffect]]:
    """The laws of forces among the effects called `names`.

    What ripples along the way is found without a law, and has a name of its own.
    """
    laws = {kind.name: kind for kind in effects("nonlinear")}
    return [laws[name] for name in names if name in laws]
