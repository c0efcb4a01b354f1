"""Pages look alike on every machine: what a user set for figures of their own stays outside."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

# For signs of names that matplotlib's own font lacks; the last, its own from 3.11 on, has a box.
_FOR_OTHER_SIGNS = (
    *("Noto Sans CJK JP", "Yu Gothic", "Microsoft YaHei", "Malgun Gothic", "Hiragino Sans"),
    *("Arial Unicode MS", "Segoe UI Emoji", "Last Resort High-Efficiency"),
)
_LOCK = Lock()
_drawing: list[Any] = []  # a context for each that draws now


@contextmanager
def own_look() -> Iterator[None]:
    """Draw by matplotlib's defaults, and not by a style, a matplotlibrc or a notebook's fonts.

    These settings are the process's: of several threads that draw, the first puts the user's away,
    and the last brings them back.
    """
    import matplotlib.font_manager

    with _LOCK:
        if not _drawing:
            usual = matplotlib.rc_context()
            usual.__enter__()
            matplotlib.rcdefaults()
            matplotlib.rcParams["text.parse_math"] = False  # a dollar in a name is a dollar
            known = matplotlib.font_manager.get_font_names()
            others = [font for font in _FOR_OTHER_SIGNS if font in known]
            matplotlib.rcParams["font.family"] = ["DejaVu Sans", *others]
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
