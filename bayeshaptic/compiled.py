"""Inner loops compiled by numba: once per installation, kept on disk where that can be written.

A file of kernels is imported by the functions that call it, so that nobody waits for numba who does
not need it.  Beside each kernel stands a plain NumPy form that it is tested against.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from functools import cache, partial
from typing import Any, TypeVar, overload

from bayeshaptic.errors import InputError, one_line

F = TypeVar("F", bound=Callable[..., Any])

_FAST = {"contract"}  # a * b + c in one rounding; nothing else that changes a number
_tell: Callable[[], None] | None = None
_listening = False


@overload
def kernel(function: F) -> F: ...


@overload
def kernel(*, inline: bool = False, exact: bool = False) -> Callable[[F], F]: ...


def kernel(
    function: F | None = None, *, inline: bool = False, exact: bool = False
) -> F | Callable[[F], F]:
    """Decorator: compile `function` when it is first called, without Python objects.

    Sums are taken in the order written, by one thread; a division by zero gives inf or nan.

    Parameters
    ----------
    function : callable
        On arrays and numbers.  Kernels that it calls stand in the same file, or are parts that say
        at the head of theirs who contains them: what is kept on disk is renewed when its own file
        changes, and no other.
    inline : bool
        Part of the kernels that call it: nothing is kept of it by itself.
    exact : bool
        Sums in the order in which they are written, so that every machine finds the same.
    """
    if function is None:
        return partial(kernel, inline=inline, exact=exact)  # type: ignore[return-value]
    numba = _numba()
    _listen()
    njit: Any = numba.njit
    options = {"fastmath": False if exact else _FAST, "error_model": "numpy", "nogil": True}
    # A part that stayed a function would be another copy of it, rounded otherwise, in the process
    # that compiles it than in those that load what calls it.
    options["forceinline"] = inline
    try:
        compiled: F = njit(cache=not inline, **options)(function)
    except RuntimeError:  # no folder that can be written: compiled anew in each process
        compiled = njit(**options)(function)
    return compiled


@cache
def callback(function: Callable[..., float]) -> Any:
    """A function of numbers, and of an array at last, that a kernel takes as an argument.

    The kernel is compiled once, whatever function it is given.

    Parameters
    ----------
    function : callable
        Of a module; returns a number.  The last of its arguments is an array: a kernel gives it
        where that begins (`.ctypes`), one number in the place of an array's seven.
    """
    numba = _numba()
    cfunc, float64, types = numba.cfunc, numba.float64, numba.types
    _listen()
    numbers = [float64] * (function.__code__.co_argcount - 1)
    signature = float64(*numbers, types.CPointer(float64))
    try:
        return cfunc(signature, cache=True, error_model="numpy")(function)
    except RuntimeError:
        return cfunc(signature, error_model="numpy")(function)


@cache
def _numba() -> Any:
    """numba; a setting of the environment that it cannot be loaded with is told in one line."""
    settings = {name: value for name, value in os.environ.items() if name.startswith("NUMBA_")}
    try:
        with warnings.catch_warnings():
            # It goes on without what it cannot read, and tells that with a traceback.
            unread = "Environment variable 'NUMBA_"
            warnings.filterwarnings("error", unread, category=RuntimeWarning)
            import numba
    except (ValueError, RuntimeError, RuntimeWarning) as error:
        if not settings:
            raise
        named = [name for name in settings if f"'{name}'" in str(error)] or [*settings]
        said = " ".join(f"{name}={settings[name]}" for name in named)
        raise InputError(
            f"{one_line(said)} in the environment: numba cannot be loaded with it; unset it, or "
            "give a value that numba knows"
        ) from None
    return numba


def when_compiling(tell: Callable[[], None] | None) -> None:
    """Have `tell` called whenever a kernel is compiled instead of loaded; None: nobody."""
    global _tell
    _tell = tell


def _listen() -> None:
    """Be told of each compilation by numba."""
    global _listening
    if _listening:
        return
    _listening = True
    from numba.core import event

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: object) -> None:
            if _tell is not None:
                _tell()

        def on_end(self, _: object) -> None:
            pass

    event.register("numba:compile", Listener())
