"""Pages look alike on every machine: what a user set for figures of their own stays outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

_LOCK = Lock()
_drawing: list[Any] = []  # a context for each that draws now


@contextmanager
def own_look() -> Iterator[None]:
    """Draw by matplotlib's defaults, and not by a style, a matplotlibrc or a notebook's fonts.

    These settings are the process's: of several threads that draw, the first puts the user's away,
    and the last brings them back.
    """
    import matplotlib

    with _LOCK:
        if not _drawing:
            usual = matplotlib.rc_context()
            usual.__enter__()
            matplotlib.rcdefaults()
            matplotlib.rcParams["text.parse_math"] = False  # a dollar in a name is a dollar
        else:
            usual = _drawing[-1]
        _drawing.append(usual)
    try:
        yield
    finally:
        with _LOCK:
            _drawing.pop()
            if not _drawing:
                usual.__exit__(None, None, None)
