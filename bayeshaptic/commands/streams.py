"""Standard streams that are closed, full, read by nobody, or lack a sign."""

from __future__ import annotations

import io
import os
import select
import sys


def open_what_is_closed() -> None:
    """Give a process that was started without streams, as by a scheduler, ones that lead nowhere.

    Their numbers would go to the next files that are opened, and what a library prints into those.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115


def write_what_can_be() -> None:
    """Have terminals that lack a sign (µ, a bar of a picture) show another one in its place."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")


def flush_output() -> None:
    """Write what is left for stdout; the error that it meets says so.

    Raises
    ------
    OSError
        Where it is full, or nobody reads it.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        error.filename = error.filename or "standard output"
        raise


def nobody_reads() -> bool:
    """Whether what read the output has ended, as ``head`` does."""
    try:
        sys.stdout.flush()
        # Nothing may be left to flush: unbuffered streams (PYTHONUNBUFFERED) have met it before.
        asked = select.poll()
        asked.register(sys.stdout, 0)
        return any(event & (select.POLLERR | select.POLLHUP) for _, event in asked.poll(0))
    except BrokenPipeError:
        return True
    except (AttributeError, OSError):  # Windows cannot ask; a stream that is no file is read
        return False


def let_go() -> None:
    """Have what cannot be written lead nowhere: the end of Python would fail by it once more."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
