"""What callers hand in, checked at the door: a wrong type or value is one line that names it.

A public function stands `at_the_door`: its annotations say what each argument may be, and `BOUNDS`
what numbers of that name may be, wherever it occurs. Annotations that are not known here (the
user's own protocols) are left to the function.
"""

from __future__ import annotations

import functools
import inspect
import math
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields
from numbers import Integral, Real
from typing import Any, TypeVar

from bayeshaptic.errors import InputError, nearest, shown
from bayeshaptic.faq import entry_of

F = TypeVar("F", bound=Callable[..., Any])
Names = Mapping[str, Any]

BOUNDS: dict[str, tuple[float, float, str]] = {
    "seed": (0, math.inf, "of at least 0"),
    **dict.fromkeys(("draws", "max_draws"), (1, math.inf, "of at least 1")),
    **dict.fromkeys(("minimum_lines", "most_evaluations"), (1, math.inf, "of at least 1")),
    "count": (2, math.inf, "of at least 2"),
    **dict.fromkeys(("ess", "budget_s"), (math.ulp(0.0), math.inf, "above 0")),
    **dict.fromkeys(("period_s", "default_period_s"), (1e-12, 1e12, "above 0, in seconds")),
    "encoder_resolution": (1e-300, 1e300, "above 0, in m or rad"),
    "lever_m": (1e-300, 1e300, "above 0, in metres"),
    "cutoff_hz": (1e-300, 1e300, "above 0, in Hz"),
    "delay_s": (0, 1e12, "of at least 0, in seconds"),
    "delay_sd_s": (0, math.inf, "of at least 0, in seconds"),
    **dict.fromkeys(("risk", "risks"), (1e-12, 1 - 1e-12, "between 0 and 1, as in 0.01")),
    "p": (0, 1, "between 0 and 1, as in 0.05"),
    **dict.fromkeys(("start", "add"), (-1e300, 1e300, "other than NaN or infinity")),
    "factors": (0, 1e300, "of at least 0"),
    "frequency_hz": (-1e300, 1e300, "other than NaN or infinity, in Hz"),
    **dict.fromkeys(("stiffness", "damping"), (-math.inf, math.inf, "other than NaN")),
}
"""Lowest and highest value of numbers by their name, and how to say it."""

_ALIAS = re.compile(r"(?<![\w.])(collections\.abc|typing)\.")
_MAY_BE_INFINITE = ("delay_sd_s", "low", "stiffness")

_OFFERED = {
    "source": (("model", "structure"), "a Model, Fit, Posterior, Case, Analysis or Closed"),
    "Extension": (("apply",), "an effect, as those of bayeshaptic.effects.linear"),
    "result": (("analysis",), "what bayeshaptic.analyse or close_loop returned"),
    "StudyAnalysis": (("new_person",), "a StudyAnalysis (see bayeshaptic.analyse_study)"),
    "Damping": (("smoothing",), "a Backward or a LowPass"),
}
"""Attributes of which a value has one, where several classes will do: by argument or annotation."""

_MAKERS = {
    "Recording": "bayeshaptic.read_recording",
    "Etfe": "bayeshaptic.estimate_etfe",
    "Model": "bayeshaptic.grasped",
    "Fit": "bayeshaptic.least_squares",
    "Posterior": "bayeshaptic.sample",
    "CriticalStiffness": "bayeshaptic.critical_stiffness",
    "Study": "bayeshaptic.read_study",
    "Device": "bayeshaptic.load_device",
    "Prior": "bayeshaptic.LogNormal",
}


def at_the_door(function: F) -> F:
    """Refuse arguments that cannot be what the annotations say, in one line, before any work."""
    signature = inspect.signature(function)
    names = inspect.unwrap(function).__globals__

    @functools.wraps(function)
    def door(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:
            unknown = [name for name in kwargs if name not in signature.parameters]
            near = nearest(unknown[0], signature.parameters) if unknown else ""
            raise TypeError(f"{function.__name__}() {error}{near}") from None
        try:
            for name, value in bound.arguments.items():
                parameter = signature.parameters[name]
                value = bound.arguments[name] = _plain(value)
                if parameter.kind not in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
                    _check(name, value, str(parameter.annotation), names)
            return function(*bound.args, **bound.kwargs)
        except InputError as error:  # a traceback shows its notes
            more = entry_of(error)
            if more is not None and not getattr(error, "__notes__", ()):
                error.add_note(more.command)
            raise

    return door  # type: ignore[return-value]


def check_fields(thing: Any, names: Names) -> None:
    """The same for the fields of a dataclass, in its ``__post_init__``.

    Parameters
    ----------
    thing : dataclass
    names : mapping
        What its annotations mean: ``globals()``.

    Raises
    ------
    InputError
        Where a field cannot be; the message names it.
    """
    for field in fields(thing):
        value = _plain(getattr(thing, field.name))
        object.__setattr__(thing, field.name, value)
        _check(field.name, value, str(field.type), names)


def _plain(value: Any) -> Any:
    """A number of a rarer type (a fraction, a short float of NumPy) as a float."""
    odd = isinstance(value, Real) and not isinstance(value, float | Integral)
    return float(value) if odd else value


def instance(name: str, value: Any, kinds: type | tuple[type, ...], hint: str) -> Any:
    """`value`, where it is one of these classes.

    Parameters
    ----------
    name : str
    value : object
    kinds : type or tuple of type
    hint : str
        What to give instead, as in "an Etfe (see bayeshaptic.estimate_etfe)".

    Raises
    ------
    InputError
        Where it is none.
    """
    if isinstance(value, kinds):
        return value
    raise InputError(f"{name} is {shown(value)}; give {hint}")


def _check(name: str, value: Any, annotation: str, names: Names) -> None:
    parts = _split(annotation, " | ")
    if name in _OFFERED and annotation in ("Any", "Result"):
        parts = [name]
    endless = (
        "float" in parts
        and isinstance(value, Real)
        and math.isinf(value)
        and name not in _MAY_BE_INFINITE
    )
    if any(_is(value, part, names) for part in parts) and not endless:
        if name in BOUNDS and _numbers(value):
            _check_bounds(name, value)
        return
    hints = [hint for part in parts if (hint := _hint(part))]
    for part in parts:  # one of a mapping's values, where it is a mapping
        if part.startswith("Mapping[") and isinstance(value, Mapping):
            within = _split(part[len("Mapping[") : -1], ", ")[1]
            name, value = next(
                (f"{name}[{shown(key)}]", one)
                for key, one in value.items()
                if not _any(one, within, names)
            )
            hints = [_plain_word(within)]
    raise InputError(f"{name} is {shown(value)}; give {' or '.join(dict.fromkeys(hints))}")


def _check_bounds(name: str, value: Any) -> None:
    import numpy as np

    low, high, words = BOUNDS[name]
    many, numbers = isinstance(value, Iterable), np.asarray(value, float)
    if not np.all((low <= numbers) & (numbers <= high)):
        raise InputError(
            f"{name} is {shown(value)}; give {'numbers' if many else 'a number'} {words}"
        )


def _is(value: Any, part: str, names: Names) -> bool:
    """Whether a value is what one part of an annotation says."""
    if part in _PLAIN:
        return _PLAIN[part](value)
    if part in _OFFERED:
        return any(hasattr(value, name) for name in _OFFERED[part][0])
    kind, _, inside = part.partition("[")
    if inside:
        within = _split(inside[:-1], ", ")
        if kind == "Mapping":
            return isinstance(value, Mapping) and all(
                _any(one, within[1], names) for one in value.values()
            )
        if kind in ("Sequence", "tuple"):
            once = str | Mapping | Iterator  # what is read once is empty when it is used
            if isinstance(value, once) or not isinstance(value, Iterable):
                return False
            if kind == "tuple" and within[-1] != "...":
                return len(within) == len(list(value)) and all(
                    _any(one, part, names) for one, part in zip(value, within, strict=True)
                )
            if kind == "tuple" and not len(list(value)):
                return False
            return all(_any(one, within[0], names) for one in value)
        if kind == "Iterable":
            return isinstance(value, Iterable) and not isinstance(value, str | Mapping)
        return kind != "Callable" or callable(value)
    if kind in ("Progress", "Executor", "Rule"):
        return callable(value)
    first, *others = kind.split(".")
    found = functools.reduce(lambda part, name: getattr(part, name, None), others, names.get(first))
    if found is None or isinstance(found, type):
        return found is None or isinstance(value, found) and not isinstance(value, type)
    return _any(value, _ALIAS.sub("", str(found)), names)  # a name for a union or a tuple


def _any(value: Any, annotation: str, names: Names) -> bool:
    return any(_is(value, part, names) for part in _split(annotation, " | "))


def _numbers(value: Any) -> bool:
    import numpy as np

    try:
        array = np.asarray(value)
    except ValueError:
        return False
    return array.dtype.kind in "iuf" or array.size == 0


_PLAIN: dict[str, Callable[[Any], bool]] = {
    "Any": lambda value: True,
    "None": lambda value: value is None,
    "bool": lambda value: isinstance(value, bool),
    "int": lambda value: isinstance(value, Integral) and not isinstance(value, bool),
    "float": lambda value: (
        isinstance(value, Real) and not isinstance(value, bool) and not math.isnan(value)
    ),
    "str": lambda value: isinstance(value, str),
    "Path": lambda value: isinstance(value, os.PathLike),
    "os.PathLike[str]": lambda value: isinstance(value, os.PathLike),
    "ArrayLike": _numbers,
    "Floats": _numbers,
}
_SAID = {
    "bool": "True or False",
    "int": "a whole number",
    "float": "a number",
    "str": "a text",
    "Path": "a path",
    "os.PathLike[str]": "a path",
    "ArrayLike": "numbers",
    "Floats": "an array of numbers",
    "Progress": "a function of the share done and a word",
    "Columns": "a text or mapping, as in 'time=t,force=u[N],position=q[mm]'",
    "Span": "two numbers, of which one may be None",
    "Executor": "one of bayeshaptic.jobs.executors",
}


def _hint(part: str) -> str:
    """What a part of an annotation asks for, in words; empty for None."""
    if part in _SAID:
        return _SAID[part]
    if part in _OFFERED:
        return _OFFERED[part][1]
    kind, _, inside = part.partition("[")
    if kind in ("Sequence", "Iterable", "tuple"):
        within = [one for one in _split(inside[:-1], ", ") if one != "..."]
        each = [f"{len(within)} numbers"] if set(within) == {"float"} and len(within) > 1 else None
        return f"a sequence of {' or '.join(each or map(_plain_word, within[:1]))}"
    if kind == "Mapping":
        return f"a mapping of names to {_plain_word(_split(inside[:-1], ', ')[1])}"
    if part == "None":
        return ""
    article = "an" if kind[:1] in "AEIOU" else "a"
    return f"{article} {kind}" + (f" (see {_MAKERS[kind]})" if kind in _MAKERS else "")


def _plain_word(annotation: str) -> str:
    return " or ".join(filter(None, map(_hint, _split(annotation, " | "))))


def _split(text: str, by: str) -> list[str]:
    """`text` split at `by`, but not within brackets."""
    parts, depth, last = [], 0, 0
    for match in re.finditer(rf"[\[\]]|{re.escape(by)}", text):
        if match[0] == "[":
            depth += 1
        elif match[0] == "]":
            depth -= 1
        elif depth == 0:
            parts.append(text[last : match.start()])
            last = match.end()
    return [*parts, text[last:]]
