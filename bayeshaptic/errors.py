"""What goes wrong, in one line that says where and what to do."""

from __future__ import annotations

import difflib
import errno
import os
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any


class InputError(ValueError):
    """Input that cannot be used: the message names the place and the cure in one line.

    The command line prints the message and exits with status 2; nothing half-written is left.

    Parameters
    ----------
    message : str
    topic : str, optional
        The entry of `bayeshaptic.faq` that says more, where it is not that of the file that raises.
    """

    def __init__(self, message: str, topic: str | None = None) -> None:
        super().__init__(message)
        self.topic = topic


class BayeshapticWarning(UserWarning):
    """Something a user should know, but that does not stop the work."""


@dataclass(frozen=True)
class Notice:
    """A sentence about the input or the result that belongs into the report.

    Attributes
    ----------
    level : str
        ``"note"`` for something to know, ``"warning"`` for something to act on.
    topic : str
        One word or two: what it is about, for example ``"feedback"`` or ``"units"``.
    text : str
        The sentence, with numbers and units, and what to do.
    about : tuple of str
        What a decision needs to know of it, so that none hangs on the words of `text`: of units the
        quantities ("force", "position", "time") that a warning doubts, or whose unit was assumed as
        a note says; of feedback "undecided" where that is only a doubt, and "or noise of a band"
        where that would look the same; of a recording that says too little the reason and what to
        do.
    """

    level: str
    topic: str
    text: str
    about: tuple[str, ...] = ()


def refuse_place(path: Path, example: str) -> None:
    """Say before any work that a file cannot be written there.

    Parameters
    ----------
    path : Path
    example : str
        Of a file's name.

    Raises
    ------
    InputError
        Where `path` is a folder, or its folder does not exist.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file, such as {path / example}")
    if not path.absolute().parent.is_dir():
        raise InputError(f"{path.parent}: no such folder; make it first")


def refuse_no_path(path: Path) -> None:
    """Refuse a path that no system can follow.

    Raises
    ------
    InputError
        Where links on the way to `path` lead in a circle, or where no path can be such.
    """
    try:
        os.stat(path)
    except ValueError:  # a zero byte
        raise InputError(f"{shown(str(path))} is no path", topic="file") from None
    except OSError as error:
        if error.errno == errno.ELOOP:
            told = "a link that leads in a circle; name the file or folder itself"
            raise InputError(f"{path}: {told}", topic="file") from None


def nearest(word: str, known: Iterable[str]) -> str:
    """`` (did you mean 'x'?)`` where something known is close to `word`, otherwise nothing."""
    by_lower_case = {name.lower(): name for name in known}
    found = difflib.get_close_matches(word.lower(), by_lower_case, n=1, cutoff=0.6)
    return f" (did you mean '{by_lower_case[found[0]]}'?)" if found else ""


def nearest_or_all(word: str, known: Collection[str]) -> str:
    """`nearest`, or all that is known where nothing is close."""
    return nearest(word, known) or f"; there are {', '.join(known)}"


def such(count: int, what: str) -> str:
    """How often something was met: ``"1 such row"``, ``"3 such rows"``."""
    return f"{count} such {what}{'' if count == 1 else 's'}"


def shown(value: Any) -> str:
    """A value in a few words, for a message: short, and its type where that is the point."""
    if isinstance(value, str | Real | None) or isinstance(value, tuple | list) and len(value) < 4:
        text = " ".join(repr(value).split())
        return text if len(text) <= 60 else f"{text[:57]}..."
    dtype = getattr(value, "dtype", None)  # of an array it is what it holds that is wrong
    return f"of type {type(value).__name__}{f' of {dtype}' if dtype is not None else ''}"


def printable(text: str) -> str:
    """`text` without line breaks and signs that would steer a terminal: names from files."""
    return "".join(sign if sign.isprintable() else "?" for sign in text)


def one_line(text: str) -> str:
    """`text` in one line, printable: what libraries say of damaged files."""
    return printable(" ".join(text.split()))


def unique(notices: Iterable[Notice]) -> tuple[Notice, ...]:
    """Warnings first, without repetitions."""
    return tuple(sorted(dict.fromkeys(notices), key=lambda notice: notice.level != "warning"))


def warned(message: Warning | str, category: type[Warning]) -> str:
    """What a warning says, in one line."""
    place = "" if issubclass(category, BayeshapticWarning) else f"{category.__name__}: "
    return place + one_line(str(message))


def describe(error: BaseException) -> str:
    """One line that says what went wrong, for people: no traceback, no line breaks."""
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename}: {error.strerror}" if error.filename else error.strerror
    text = one_line(str(error))
    return text if isinstance(error, InputError) else f"{type(error).__name__}: {text}"
