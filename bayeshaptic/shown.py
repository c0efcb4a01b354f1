"""How results show themselves at a prompt, in a notebook, and as a table of pandas."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from html import escape
from typing import Any

from bayeshaptic.errors import InputError


class Shown:
    """A result that says in three lines, with units, what is in it."""

    @abstractmethod
    def _lines(self) -> tuple[str, ...]:
        """What `repr` shows: what it is, then what matters most of it."""

    def __repr__(self) -> str:
        return "\n  ".join(self._lines())

    def _repr_html_(self) -> str:
        first, *rest = (escape(line) for line in self._lines())
        return f"<div><strong>{first}</strong>{''.join(f'<br>{line}' for line in rest)}</div>"


def data_frame(rows: Iterable[Mapping[str, Any]], index: str | None = None) -> Any:
    """A ``pandas.DataFrame``, a row a mapping.

    Raises
    ------
    InputError
        If pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise InputError(
            "pandas is not installed, and to_dataframe() needs it: pip install pandas."
        ) from None
    frame = pandas.DataFrame(list(rows))
    return frame if index is None else frame.set_index(index)


def listed(words: Iterable[str], most: int = 6) -> str:
    """The first words of many: ``"m1, b1, bc and 8 more"``."""
    known = list(words)
    if len(known) <= most:
        return ", ".join(known)
    return f"{', '.join(known[:most])} and {len(known) - most} more"
