"""What the command line and its workers do without, in processes that nobody else uses.

Frequent garbage collection and one at the end, docstrings that libraries rewrite, modules that they
import for functions which no report calls, and settings for figures that are none of ours.
"""

from __future__ import annotations

import atexit
import gc
import os
import sys
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from types import ModuleType
from typing import Any

_LATER = (
    "scipy.stats",
    "scipy.interpolate",
    "scipy.spatial",
    "numpy.f2py",
    "numpy.testing",
    "tqdm",
)


def collect_garbage_rarely(objects: int = 50_000) -> None:
    """Collect objects that refer to each other in circles every so many, and not every 700.

    A figure is thousands of objects: collecting takes a fourteenth of a report.  At the end nothing
    is collected: taking a quarter of a million objects of libraries apart, one by one, in a process
    that ends anyway, took 0.4 s.

    Parameters
    ----------
    objects : int
        With a million a single report ends with 40 MB that nobody needs, and saves a sixtieth more;
        many in one process would grow by 50 MB each, until there are so many objects: 760 MB.
    """
    gc.set_threshold(objects, 20, 20)
    atexit.register(gc.freeze)


def draw_by_defaults() -> None:
    """Have matplotlib leave alone what a user has set for figures of their own.

    Reports are drawn by its defaults (`report/figures/drawing/look.py`).  A backend of another
    version in MPLBACKEND kept it from being imported at all.  To be called before it is.
    """
    os.environ |= {"MATPLOTLIBRC": os.devnull, "MPLBACKEND": "agg"}


@cache
def lighten_imports() -> None:
    """Have SciPy and matplotlib not rewrite their docstrings while they are imported.

    They do so for some 900 functions and classes, a sixteenth of a report, and matplotlib lists
    what the `set` of each of 110 classes takes, a fiftieth.  What SciPy does without is what it
    does under ``python -OO``.  To be called before either is imported; versions that have no such
    names are left as they are.  SciPy's optimisers, its filters and emcee are imported here,
    without what they bring along.
    """
    with suppress(ImportError, AttributeError):
        from scipy._lib import _docscrape

        _docscrape.FunctionDoc = partial(_docscrape.FunctionDoc, doc="")
    with suppress(ImportError, AttributeError):
        import matplotlib.artist

        matplotlib.artist.kwdoc = lambda artist: ""
        every: Any = matplotlib.artist.Artist  # what matplotlib's stubs leave out
        every._update_set_signature_and_docstring = classmethod(lambda cls: None)
    _import_lightly("scipy.optimize", "scipy.signal", "emcee")


def _import_lightly(*names: str) -> None:
    """Import modules while what they hardly use is stood in for.

    SciPy's filters and optimisers import its statistics, splines and trees, and NumPy's tests and
    its compiler of Fortran; emcee imports tqdm: for functions that no report calls, 0.5 s of the
    5 s of processor time of a clean report.  Whatever they call of it is imported then.  Where that
    does not work they are as not imported.
    """
    before = set(sys.modules)
    away = {name: name.rpartition(".") for name in _LATER if name not in before}
    for name, (package, _, own) in away.items():
        sys.modules[name] = _Later(name)
        if package:  # asked for under this name, too
            setattr(import_module(package), own, sys.modules[name])
    try:
        for name in names:
            import_module(name)
    except Exception:
        for name in set(sys.modules) - before:
            if any(f"{name}.".startswith(f"{one}.") for one in names):
                del sys.modules[name]
    finally:
        for name, (package, _, own) in away.items():
            if isinstance(sys.modules.get(name), _Later):
                del sys.modules[name]
                if package:
                    delattr(sys.modules[package], own)


class _Later(ModuleType):
    """Stands in for a module of which only functions and classes are called."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return partial(_called, self.__name__, name)


def _called(module: str, name: str, *args: Any, **options: Any) -> Any:
    return getattr(import_module(module), name)(*args, **options)
