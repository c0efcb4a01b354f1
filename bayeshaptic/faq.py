"""What each message means: the entries of `faq.md`, for pages and for `bayeshaptic explain`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bayeshaptic.errors import InputError, Notice, describe, nearest_or_all

_ROOT = Path(__file__).parent
_ENTRY = re.compile(
    r"^\(faq-([\w-]+)\)=\n### ([^\n]+)\n(.*?)(?=^\(faq-|^## |\Z)", re.MULTILINE | re.DOTALL
)
_PLACES = re.compile(r"<!-- refuses: (.*?) -->")
_LINK = re.compile(r"\[([^\]]+)\]\((?:\.\./)?([^)]+)\)")


@dataclass(frozen=True)
class Entry:
    """What one kind of message means, and what to do.

    Attributes
    ----------
    word : str
        Its name, as in ``bayeshaptic explain feedback``.
    title : str
    paragraphs : tuple of str
    places : tuple of str
        Files and folders of the package whose refusals it explains.
    """

    word: str
    title: str
    paragraphs: tuple[str, ...]
    places: tuple[str, ...]

    @property
    def command(self) -> str:
        """How to read it."""
        return f"bayeshaptic explain {self.word}"


@cache
def entries() -> dict[str, Entry]:
    """Every entry by its word, in the order of the file."""
    text = (_ROOT / "faq.md").read_text(encoding="utf-8")
    found = {}
    for word, title, body in _ENTRY.findall(text):
        places = tuple(" ".join(_PLACES.findall(body)).split())
        parts = (" ".join(part.split()) for part in _PLACES.sub("", body).split("\n\n"))
        found[word] = Entry(word, title, tuple(part for part in parts if part), places)
    return found


def entry(topic: str) -> Entry:
    """The entry of a notice's topic, or of a word.

    Raises
    ------
    InputError
        If there is none.
    """
    known = entries()
    word = "-".join(topic.lower().split())
    if word in known:
        return known[word]
    for one in known.values():
        if topic in one.title.split(", "):
            return one
    raise InputError(f"no entry {topic!r}{nearest_or_all(word, known)}")


def entry_of(error: BaseException) -> Entry | None:
    """The entry of an error: the one that it names, or that of the file which raised it.

    None for a refusal by code outside the package.
    """
    places = _places(error)
    if isinstance(error, InputError):
        word = error.topic or (_topic(places[-1]) if places and places[-1] else None)
        return entry(word) if word else None
    if isinstance(error, OSError):
        return entry("file" if any(p.startswith("recordings/") for p in places) else "place")
    return entry("defect")


def _places(error: BaseException) -> list[str]:
    """The files that the error came through, as ``recordings/checks/check.py``; "" for others."""
    places, trace = [], error.__traceback__
    while trace is not None:
        path = Path(trace.tb_frame.f_code.co_filename)
        places.append(path.relative_to(_ROOT).as_posix() if path.is_relative_to(_ROOT) else "")
        trace = trace.tb_next
    return places


def _topic(place: str) -> str:
    """The word of the entry that explains the refusals of a file: that with the longest path."""
    matching = [
        (len(start), one.word)
        for one in entries().values()
        for start in one.places
        if place == start or place.startswith(f"{start}/")
    ]
    return max(matching)[1] if matching else "arguments"


def explained(message: BaseException | Notice) -> str:
    """An error or a notice in one line, with the command that says more."""
    if isinstance(message, Notice):
        return f"{message.text.strip()} [{entry(message.topic).command}]"
    found = entry_of(message)
    return describe(message) + (f" [{found.command}]" if found else "")


def without_links(paragraph: str) -> str:
    """A paragraph for where nothing can be followed: a link is its text and the file."""
    return _LINK.sub(r"\1 (\2)", paragraph)
