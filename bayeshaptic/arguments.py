"""What callers hand in, checked at the door: a wrong type or value is one line that names it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Integral, Real
from typing import Any

from bayeshaptic.errors import InputError


def number(
    name: str,
    value: Any,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
) -> float:
    """A finite number that is at least `least`, above `above` and at most `most`.

    Raises
    ------
    InputError
        Where it is none; the message says what is asked for.
    """
    is_number = isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    if is_number and least <= value <= most and value > above:
        return float(value)
    bounds = [
        f"{word} {bound:g}"
        for word, bound in (("of at least", least), ("above", above), ("of at most", most))
        if math.isfinite(bound)
    ]
    raise InputError(f"{name} is {shown(value)}; give a number {' and '.join(bounds)}".rstrip())


def whole(name: str, value: Any, least: int = 0) -> int:
    """A whole number of at least `least`.

    Raises
    ------
    InputError
        Where it is none.
    """
    if isinstance(value, Integral) and not isinstance(value, bool) and int(value) >= least:
        return int(value)
    raise InputError(f"{name} is {shown(value)}; give a whole number of at least {least}")


def band(name: str, value: Any) -> tuple[float, float]:
    """Two frequencies in Hz, of which the first is the lower.

    Raises
    ------
    InputError
        Where they are none.
    """
    try:
        low, high = (number(name, end, least=0.0) for end in value)
    except (TypeError, ValueError):  # an InputError is a ValueError
        low, high = 1.0, 0.0
    if low < high:
        return low, high
    raise InputError(f"{name} is {shown(value)}; give two frequencies in Hz, as in (0.7, 200)")


def instance(name: str, value: Any, kinds: type | tuple[type, ...], hint: str) -> Any:
    """`value`, where it is one of these classes.

    Parameters
    ----------
    name : str
    value : object
    kinds : type or tuple of type
    hint : str
        What to give instead, as in "an Etfe; see bayeshaptic.estimate_etfe".

    Raises
    ------
    InputError
        Where it is none.
    """
    if isinstance(value, kinds):
        return value
    raise InputError(f"{name} is {shown(value)}; give {hint}")


def mapping(name: str, value: Any, kinds: type | tuple[type, ...], hint: str) -> dict[str, Any]:
    """A mapping of names to things of these classes.

    Raises
    ------
    InputError
        Where it is none; the message names the entry.
    """
    instance(name, value, Mapping, f"a mapping of names to {hint}")
    for key, entry in value.items():
        instance(f"{name}[{key!r}]", entry, kinds, hint)
    return dict(value)


def shown(value: Any) -> str:
    """A value in a few words, for a message: short, and its type where that is the point."""
    if isinstance(value, str | Real | None) or isinstance(value, tuple) and len(value) < 4:
        text = repr(value)
        return text if len(text) <= 60 else f"{text[:57]}..."
    return f"of type {type(value).__name__}"
