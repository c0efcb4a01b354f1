"""Pages look alike on every machine: what a user set for figures of their own stays outside."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock
from typing import Any

_NO_SIGN = "Glyph .* missing from"  # of a name, which matplotlib's own font lacks
_LOCK = Lock()
_drawing: list[Any] = []  # a context for each that draws now
_own_filter: list[Any] = []  # of warnings, while somebody draws


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
            warnings.filterwarnings("ignore", _NO_SIGN)  # browsers have it, and tables
            _own_filter.append(warnings.filters[0])
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
                mine = _own_filter.pop()
                if mine in warnings.filters:  # not where somebody has reset them
                    warnings.filters.remove(mine)  # type: ignore[attr-defined]
