"""TOML tables read with care: every slip is one line that names file, place and cure."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from bayeshaptic.errors import InputError, nearest, refuse_no_path

# A study of a thousand recordings has 100 kB; nothing in one is nested deeper than a mapping of
# columns in a recording.
MOST_BYTES = 1_000_000
LONGEST_LINE = 10_000
DEEPEST = 8


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises
    ------
    InputError
        Where the file is missing, not text, not TOML, larger than `MOST_BYTES`, or nested deeper
        than `DEEPEST`.
    """
    refuse_no_path(path)
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        text = content.decode("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path}: cannot be read as text ({error}); save it as UTF-8, as TOML is"
        ) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read as text ({error})") from None
    # The time that the parser takes grows with the square of what stands in one line.
    if len(content) > MOST_BYTES or max(map(len, text.splitlines()), default=0) > LONGEST_LINE:
        raise InputError(
            f"{path}: larger than {MOST_BYTES // 1000} kB, or with a line of more than "
            f"{LONGEST_LINE} characters; this is no study or device file"
        )
    try:
        found = tomllib.loads(text.replace("\r\n", "\n"))
    except ValueError as error:  # TOMLDecodeError is one; so is a number of 5000 digits
        raise InputError(f"{path}: not valid TOML: {error}") from None
    except RecursionError:
        found = {}
        depth = DEEPEST + 1
    else:
        depth = _depth(found)
    if depth > DEEPEST:
        raise InputError(f"{path}: tables or lists nested more than {DEEPEST} deep; flatten them")
    return found


def _depth(value: object) -> int:
    """How deep tables and lists are nested, as far as it matters."""
    layer, depth = [value], 0
    while layer and depth <= DEEPEST:
        depth += 1
        layer = [
            inner
            for item in layer
            if isinstance(item, Mapping | list)
            for inner in (item.values() if isinstance(item, Mapping) else item)
            if isinstance(inner, Mapping | list)
        ]
    return depth


def _short(value: object) -> str:
    return shown if len(shown := repr(value)) <= 60 else f"{shown[:57]}..."


class Table:
    """A TOML table that remembers where it stands, for messages.

    Parameters
    ----------
    content : object
        What TOML gave; anything but a table is refused.
    where : str
        File and table name, the beginning of every message.
    known : iterable of str or None
        The keys it may have; None where any key will do.
    """

    def __init__(self, content: object, where: str, known: Iterable[str] | None = None) -> None:
        if not isinstance(content, Mapping):
            raise InputError(
                f"{where} must be a table of 'key = value' lines, not {_short(content)}"
            )
        self.content: Mapping[str, Any] = content
        self.where = where
        if known is not None:
            self._refuse_unknown(tuple(known))

    def _refuse_unknown(self, known: tuple[str, ...]) -> None:
        for key in self.content:
            if key not in known:
                raise InputError(
                    f"{self.where} has an unknown key '{key}'{nearest(key, known)}; "
                    f"known keys: {', '.join(known)}"
                )

    def wrong(self, key: str, expected: str) -> InputError:
        """The error for a value of the wrong type."""
        return InputError(
            f"{self.where}: {key} must be {expected}, not {_short(self.content[key])}"
        )

    def number(self, key: str, lowest: float = -math.inf, above: bool = False) -> float | None:
        """A finite number of at least `lowest` (`above`: larger than it), or None where absent."""
        value = self.content.get(key)
        if value is None:
            return None
        usable = isinstance(value, int | float) and not isinstance(value, bool)
        usable = usable and abs(value) < 1e300  # neither infinite nor an integer beyond floats
        if not usable or value < lowest or (above and value == lowest):
            bound = (
                "" if lowest == -math.inf else f" {'above' if above else 'of at least'} {lowest:g}"
            )
            raise self.wrong(key, f"a number{bound}")
        return float(value)

    def text(self, key: str, choices: tuple[str, ...] = ()) -> str | None:
        """A piece of text, one of `choices` where they are given, or None where absent."""
        value = self.content.get(key)
        if value is None:
            return None
        if not isinstance(value, str) or not value.strip():
            raise self.wrong(key, "text")
        if choices and value not in choices:
            raise self.wrong(key, " or ".join(f"'{choice}'" for choice in choices))
        return value
