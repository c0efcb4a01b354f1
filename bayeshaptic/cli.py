"""The command line: parse, run one command, and turn every error into one line and a status.

Exit status: 0 done; 1 a study of a batch failed, or a defect in bayeshaptic; 2 input or options
that cannot be used; 130 interrupted, 143 terminated, 141 where nobody reads the output any more. A
command is one module of ``bayeshaptic.commands``.
"""

from __future__ import annotations

import _thread
import argparse
import os
import re
import signal
import sys
import threading
import time
import traceback
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from bayeshaptic.commands import COMMANDS
from bayeshaptic.commands.streams import (
    flush_output,
    let_go,
    nobody_reads,
    open_what_is_closed,
    write_what_can_be,
)
from bayeshaptic.commands.talk import complain
from bayeshaptic.errors import InputError, describe, nearest, warned
from bayeshaptic.faq import explained
from bayeshaptic.jobs.own_process import collect_garbage_rarely, draw_by_defaults
from bayeshaptic.threads import one_thread_from_the_start
from bayeshaptic.version import __version__

DESCRIPTION = """\
Uncertainty reports for haptic devices: how stiff a virtual wall may be before it shakes the
user's hand, from a recording of commanded force and measured position, as a probability
distribution instead of one number."""

EPILOG = """\
example:
  bayeshaptic report lhifam-user.csv.gz -o out/

Every command has its own help: bayeshaptic COMMAND --help. With --debug, or BAYESHAPTIC_DEBUG=1 in
the environment, errors come with their traceback."""


LAST_S = 4.0  # from a signal to the end by force: all is to have ended after five seconds
AGAIN_S = 0.1  # until a signal that was lost is raised again


class _Parser(argparse.ArgumentParser):
    """An ArgumentParser whose usage errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {message} (see {self.prog} --help)\n")

    def exit(self, status: int = 0, message: str | None = None) -> NoReturn:
        """End when the help is written: at the end of Python nobody hears that it was not."""
        flush_output()
        super().exit(status, message)


class _CommandParser(_Parser):
    """The parser of one command, which says itself what it does not know."""

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def, override]
        """As that of `argparse`, but nothing unknown is left for the parser above."""
        found, unknown = super().parse_known_args(args, namespace)
        if unknown:
            option = unknown[0].partition("=")[0]
            near = nearest(option, self._option_string_actions) if option[:1] == "-" else ""
            if not near and os.path.isfile(option):
                near = (
                    ": one source at a time; several recordings of one device are a study (.toml), "
                    "of which 'bayeshaptic inspect FILE --write study.toml' makes the beginning, "
                    "and 'bayeshaptic batch' reports on each by itself"
                )
            self.error(f"unrecognized arguments: {' '.join(unknown)}{near}")
        return found, unknown


def build_parser() -> argparse.ArgumentParser:
    """The whole command line, one subparser a module of `bayeshaptic.commands`."""
    parser = _Parser(
        prog="bayeshaptic",
        description=DESCRIPTION,
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bayeshaptic {__version__}")
    commands = parser.add_subparsers(
        title="commands", metavar="COMMAND", parser_class=_CommandParser
    )
    for command in COMMANDS:
        subparser = commands.add_parser(
            command.NAME,
            help=command.SUMMARY,
            description=command.DESCRIPTION,
            epilog=f"example{'s' if command.EXAMPLES.count(chr(10)) else ''}:\n{command.EXAMPLES}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(subparser)
        subparser.add_argument(
            "--debug", action="store_true", help="show the traceback of an error"
        )
        subparser.set_defaults(run=command.run)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status; never a traceback unless asked for."""
    one_thread_from_the_start()
    collect_garbage_rarely()
    if argv is None:  # the process is ours
        draw_by_defaults()
    open_what_is_closed()
    write_what_can_be()
    debug = bool(os.environ.get("BAYESHAPTIC_DEBUG"))
    try:
        parser = build_parser()
        arguments = parser.parse_args(_joined(sys.argv[1:] if argv is None else argv))
        if not hasattr(arguments, "run"):
            parser.print_help(sys.stderr)
            return 2
        debug = debug or arguments.debug
        with _warnings_in_one_line(), _stopped_in_order(alone=argv is None):
            status = arguments.run(arguments)
            flush_output()
            return status
    except (_Stopped, KeyboardInterrupt) as stop:
        number = signal.SIGTERM if signal.SIGTERM in stop.args else signal.SIGINT
        complain("terminated" if number == signal.SIGTERM else "interrupted")
        return 128 + number
    except (InputError, OSError) as error:
        if isinstance(error, BrokenPipeError) and nobody_reads():
            return 128 + 13  # as a program that SIGPIPE ends
        if isinstance(error, OSError) and error.filename is None and not _is_somewhere():
            error.filename = "the working directory, change to another"
        if debug:
            traceback.print_exc()
        complain(f"error: {explained(error)}")
        return 2
    except Exception as error:
        if debug:
            traceback.print_exc()
        complain(
            f"error: this is a defect in bayeshaptic ({describe(error)}); please report it with "
            "the output of the same command and --debug"
        )
        return 1
    finally:
        let_go()


def _is_somewhere() -> bool:
    """Whether there is a working directory: it may have been removed since."""
    try:
        return bool(os.getcwd())
    except OSError:
        return False


class _Stopped(BaseException):
    """A signal: workers are stopped and drafts removed on the way out.

    An interrupt, too: libraries hold a KeyboardInterrupt up to tidy up by themselves.
    """


class _Signals:
    """Signals as an exception, which is raised until it got through.

    What a handler raises is lost where C calls Python, as while numba compiles. On its way out it
    is not raised again: it would interrupt what tidies up.

    Parameters
    ----------
    alone : bool
        Whether the process is ours, and ends in time. Libraries may take long to close what they
        have started: a dask cluster that was stopped while it started took six seconds.
    """

    def __init__(self, alone: bool) -> None:
        self.alone, self.over = alone, False
        self.number: int | None = None
        self._lock = threading.Lock()

    def raised(self, number: int, frame: FrameType | None) -> None:
        """The handler."""
        if self.number is None:
            self.number = number
            # Not by `threading`, whose locks the interrupted frame may hold.
            _thread.start_new_thread(self._insist, (number,))
        if not self.over and not _on_its_way():
            raise _Stopped(self.number)

    def _insist(self, number: int) -> None:
        last = time.monotonic() + LAST_S
        while self.alone or not self.over:
            time.sleep(AGAIN_S)
            if self.alone and time.monotonic() > last:
                _end_by_force(128 + number)
            with self._lock:
                if not self.over:
                    _signal_again(number)

    def end(self) -> None:
        """From here on nothing is raised."""
        with self._lock:
            self.over = True


def _signal_again(number: int) -> None:
    """To the main thread, which may wait in a system call."""
    if hasattr(signal, "pthread_kill"):
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:  # Windows
        _thread.interrupt_main(number)  # type: ignore[arg-type]


def _on_its_way() -> bool:
    """Whether the exception of a signal is being handled."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, _Stopped):
        error = error.__context__
    return error is not None


@contextmanager
def _stopped_in_order(alone: bool) -> Iterator[None]:
    """Signals become exceptions; where the process is ours `alone`, it ends in time, too."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    signals, told = _Signals(alone), sys.unraisablehook
    sys.unraisablehook = lambda lost: None if lost.exc_type is _Stopped else told(lost)
    handled = (signal.SIGTERM, signal.SIGINT)
    before = {number: signal.signal(number, signals.raised) for number in handled}
    try:
        yield
    except Exception:
        if signals.number is None:
            raise
    finally:
        signals.end()
        sys.unraisablehook = told
        for number, handler in before.items():
            signal.signal(number, handler)
    if signals.number is not None:
        raise _Stopped(signals.number)


def _end_by_force(status: int) -> None:
    import multiprocessing

    try:
        for child in multiprocessing.active_children():
            child.kill()
    finally:
        os._exit(status)


def _joined(argv: Sequence[str]) -> list[str]:
    """``--delay-s -1e-3`` as ``--delay-s=-1e-3``: argparse takes such a value for an option."""
    joined: list[str] = []
    for argument in argv:
        if joined and joined[-1].startswith("--") and re.match(r"-\.?\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined


@contextmanager
def _warnings_in_one_line() -> Iterator[None]:
    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: object = None,
        line: str | None = None,
    ) -> None:
        complain(f"warning: {warned(message, category)}")

    with warnings.catch_warnings():
        # ArviZ 0.23 announces its successor once a day.
        warnings.filterwarnings("ignore", category=FutureWarning, module="arviz")
        warnings.showwarning = show
        yield
