"""Telling whoever waits: a function of theirs, a bar in the terminal, or nobody."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from bayeshaptic.errors import InputError

if TYPE_CHECKING:
    from bayeshaptic.types import Progress

FORM = "{percentage:3.0f} % |{bar}| {elapsed}, {remaining} to go; {desc}"


def told(progress: Callable[[float, str], None] | bool | None) -> Progress | None:
    """What was given as ``progress``, as a function to call with the share done and a word.

    Parameters
    ----------
    progress : callable, bool or None
        True draws a bar on stderr.

    Raises
    ------
    InputError
        Where it is none of these.
    """
    if progress is None or progress is False:
        return None
    if progress is True:
        return Bar()
    if callable(progress):
        return progress
    raise InputError(
        f"progress is {progress!r}; give True for a bar, or a function of the share done (0 to 1) "
        "and a word"
    )


def silent(share: float, word: str) -> None:
    """Tell nobody that a `share` of the work is done, and the `word`."""


def advance(bar: Any, share: float, word: str) -> None:
    """Move a bar of tqdm's on to a `share` of the work, and show the `word`."""
    bar.set_description_str(word, refresh=False)
    bar.update(max(share - bar.n, 0.0))


class Bar:
    """A bar on stderr, which ends with the work."""

    def __init__(self) -> None:
        self._bar: Any = None

    def __call__(self, share: float, word: str) -> None:
        """Draw that a `share` (0 to 1) of the work is done, and the `word`."""
        if self._bar is None:
            from tqdm.auto import tqdm

            self._bar = tqdm(total=1.0, dynamic_ncols=True, bar_format=FORM)
        advance(self._bar, share, word)
        if share >= 1.0:
            self._bar.close()
            self._bar = None
