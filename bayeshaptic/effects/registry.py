"""Where effects are registered; `library` has all that there are."""

from __future__ import annotations

from typing import Any, TypeVar

from bayeshaptic.errors import InputError

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


def registered() -> dict[str, Any]:
    """Every effect class by its name, in the order in which they were registered."""
    return dict(_registered)
