"""What the command line and its workers do without, in processes that nobody else uses.

Frequent garbage collection and one at the end, docstrings that libraries rewrite, and modules that
they import for functions which no report calls.
"""

from __future__ import annotations

import atexit
import gc
import sys
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from types import ModuleType
from typing import Any

_LATER = ("scipy.stats", "scipy.interpolate", "scipy.spatial", "scipy.optimize")


def collect_garbage_rarely() -> None:
    """Collect objects that refer to each other in circles every 50,000 objects, and not every 700.

    A figure is thousands of objects: collecting takes a fourteenth of a report.  At the end nothing
    is collected: taking a quarter of a million objects of libraries apart, one by one, in a process
    that ends anyway, took 0.4 s.
    """
    gc.set_threshold(50_000, 20, 20)
    atexit.register(gc.freeze)


@cache
def lighten_imports() -> None:
    """Have SciPy and matplotlib not rewrite their docstrings while they are imported.

    They do so for some 900 functions and classes, a sixteenth of a report.  What SciPy does without
    is what it does under ``python -OO``.  To be called before either is imported; versions that
    have no such names are left as they are.  SciPy's filters and emcee are imported here, without
    what they bring along.
    """
    with suppress(ImportError, AttributeError):
        from scipy._lib import _docscrape

        _docscrape.FunctionDoc = partial(_docscrape.FunctionDoc, doc="")
    with suppress(ImportError, AttributeError):
        import matplotlib.artist

        matplotlib.artist.kwdoc = lambda artist: ""
    _import_lightly("scipy.signal", "emcee")


def _import_lightly(*names: str) -> None:
    """Import modules while what they hardly use is stood in for.

    SciPy's filters and emcee import its statistics, splines, trees and optimisers for functions
    that no report calls: 0.4 s of the 8 s of processor time that a report of
    data/recordings/phantom-free.csv.gz takes (median difference of six alternating pairs of runs).
    Whatever they call of it is imported then.  Where that does not work they are as not imported.
    """
    before = set(sys.modules)
    away = [name for name in _LATER if name not in before]
    sys.modules.update({name: _Later(name) for name in away})
    try:
        for name in names:
            import_module(name)
    except Exception:
        for name in set(sys.modules) - before:
            if any(f"{name}.".startswith(f"{one}.") for one in names):
                del sys.modules[name]
    finally:
        for name in away:
            if isinstance(sys.modules.get(name), _Later):
                del sys.modules[name]


class _Later(ModuleType):
    """Stands in for a module of which only functions and classes are called."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return partial(_called, self.__name__, name)


def _called(module: str, name: str, *args: Any, **options: Any) -> Any:
    return getattr(import_module(module), name)(*args, **options)
