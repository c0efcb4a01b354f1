"""The library of effects: those of this package, and those that other packages register."""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points
from typing import Any, TypeVar

from bayeshaptic.errors import InputError

ENTRY_POINT = "bayeshaptic.effects"
_registered: dict[str, Any] = {}
Kind = TypeVar("Kind", bound=type)


def register(effect: Kind) -> Kind:
    """Add an effect class to the library; usable as a decorator.

    Raises
    ------
    InputError
        If another effect has its name.
    """
    known = _registered.get(effect.name)  # type: ignore[attr-defined]
    if known is not None and known is not effect:
        raise InputError(f"there is an effect {effect.name!r} already.")  # type: ignore[attr-defined]
    _registered[effect.name] = effect  # type: ignore[attr-defined]
    return effect


@cache
def _load_own_and_installed() -> None:
    import bayeshaptic.effects.library  # noqa: F401  (importing registers)

    for point in entry_points(group=ENTRY_POINT):
        register(point.load())


def effects(family: str | None = None) -> tuple[Any, ...]:
    """The effect classes, of one family or all, in the order in which they were registered."""
    _load_own_and_installed()
    return tuple(e for e in _registered.values() if family is None or e.family == family)


def effect_class(name: str) -> Any:
    """The effect called `name`.

    Raises
    ------
    InputError
        If there is none; the message lists those there are.
    """
    _load_own_and_installed()
    if name not in _registered:
        raise InputError(f"no effect {name!r}; there are {', '.join(_registered)}.")
    return _registered[name]
