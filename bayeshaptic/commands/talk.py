"""What the command line says while it works and when it is done."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from bayeshaptic.compiled import when_compiling
from bayeshaptic.errors import one_line
from bayeshaptic.progress import FORM, advance

if TYPE_CHECKING:
    from bayeshaptic.report.reported import Reported

MOST_WARNINGS = 3


def complain(message: str) -> None:
    """One line on stderr, with the program's name before it; lost where that cannot be written.

    What it is about goes on, as Python does after a warning that is lost.
    """
    with suppress(OSError):
        print(f"bayeshaptic: {one_line(message)}", file=sys.stderr)


class Talk:
    """A progress bar on stderr where that is a terminal; results on stdout, failures on stderr.

    Parameters
    ----------
    quiet : bool
        No bar and no results; failures still show.
    """

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self._bar: Any = None
        self._compiled = False
        self._unsaid: OSError | None = None
        if not quiet and sys.stderr.isatty():
            from tqdm import tqdm

            self._bar = tqdm(
                total=1.0, leave=False, dynamic_ncols=True, bar_format=FORM, smoothing=0
            )

    def __enter__(self) -> Talk:
        when_compiling(self._compiling)
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        when_compiling(None)
        if self._bar is not None:
            self._bar.close()
        if kind is None and self._unsaid is not None:
            raise self._unsaid

    def progress(self, share: float, word: str) -> None:
        """Show that a `share` (0 to 1) of the work is done, and a `word` about what comes now."""
        if self._bar is not None:
            advance(self._bar, share, word)

    def say(self, line: str) -> None:
        """A line of the results."""
        if not self.quiet:
            self._between_bars(lambda: self.write(line))

    def complain(self, line: str) -> None:
        """A failure that does not end the command."""
        self._between_bars(lambda: complain(f"error: {line}"))

    def tell(self, done: Iterable[Reported]) -> int:
        """What became of each recording, in a few lines each; how many failed."""
        failed = 0
        for reported in done:
            if reported.headline is None:
                self.complain(f"{reported.name}: {reported.error}")
                failed += 1
                continue
            self.say(f"{reported.name}: {reported.headline.sentence}")
            if reported.remark:
                self.say(f"  {reported.remark}")
            for warning in reported.warnings[:MOST_WARNINGS]:
                self.say(f"  warning: {warning}")
            more = len(reported.warnings) - MOST_WARNINGS
            if more > 0:
                self.say(f"  and {more} more in the report")
            self.say(f"  report: {reported.page}")
        return failed

    def write(self, line: str) -> None:
        """On stdout, quiet or not; where it is full the work goes on, and the end is an error."""
        try:
            print(line, flush=True)
        except BrokenPipeError:
            raise
        except OSError as error:
            error.filename = "standard output"
            self._unsaid = error

    def _compiling(self) -> None:
        """Say why the first run takes longer; once."""
        if self._bar is not None and not self._compiled:
            self._bar.write("compiling for this machine (once per installation)", file=sys.stderr)
        self._compiled = True

    def _between_bars(self, write: Any) -> None:
        if self._bar is None:
            write()
        else:
            with self._bar.external_write_mode(file=sys.stderr):
                write()
