"""What processes that are ours alone leave undone: looking for garbage, rewriting docstrings."""

from __future__ import annotations

import gc
from contextlib import suppress
from functools import cache, partial


def look_rarely() -> None:
    """Look for objects that refer to each other in circles once in 50,000, and not in 700.

    A figure is thousands of them: the looking takes a fourteenth of a report.
    """
    gc.set_threshold(50_000, 20, 20)


@cache
def leave_unread() -> None:
    """Have SciPy and matplotlib not rewrite their docstrings while they are imported.

    They do so for some 900 functions and classes, a sixteenth of a report.  What SciPy does without
    is what it does under ``python -OO``.  To be called before either is imported; versions that
    have no such names are left as they are.
    """
    with suppress(ImportError, AttributeError):
        from scipy._lib import _docscrape

        _docscrape.FunctionDoc = partial(_docscrape.FunctionDoc, doc="")
    with suppress(ImportError, AttributeError):
        import matplotlib.artist

        matplotlib.artist.kwdoc = lambda artist: ""
