"""Options and argument types that several commands share."""

from __future__ import annotations

import argparse
import ast
import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bayeshaptic.diagnosis.options import Options
from bayeshaptic.jobs.job import Settings

MODELS = ("auto", "rigid", "free", "grasped")


def positive(text: str) -> float:
    """A finite number above zero."""
    value = _number(text)
    if value <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} must be above zero")
    return value


def non_negative(text: str) -> float:
    """A finite number, zero or above."""
    value = _number(text)
    if value < 0.0:
        raise argparse.ArgumentTypeError(f"{text!r} must not be negative")
    return value


def count(text: str) -> int:
    """A whole number above zero."""
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number above zero")
    return int(text)


def whole(text: str) -> int:
    """A whole number, zero or above."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number, zero or above")
    return int(text)


def place(text: str) -> Path:
    """A path; an empty text, as of a variable that is not set, is none."""
    if not text.strip():
        raise argparse.ArgumentTypeError("the name is empty; name a folder or file")
    return Path(text)


def band(text: str) -> tuple[float, float]:
    """``LOW,HIGH`` in Hz with 0 <= LOW < HIGH."""
    parts = text.split(",")
    if len(parts) != 2:
        raise argparse.ArgumentTypeError(
            f"{text!r} must be two frequencies in Hz, LOW,HIGH, for example 0.7,200"
        )
    low, high = (_number(part) for part in parts)
    if not 0.0 <= low < high:
        raise argparse.ArgumentTypeError(f"{text!r} must have 0 <= LOW < HIGH, in Hz")
    return low, high


def yes_or_no(text: str) -> bool:
    """``yes`` or ``no``."""
    if text not in ("yes", "no"):
        raise argparse.ArgumentTypeError(f"{text!r} must be yes or no")
    return text == "yes"


def span(text: str) -> tuple[float | None, float | None]:
    """``A:B`` with 0 <= A < B, either of which may be left out."""
    parts = text.split(":")
    if len(parts) != 2 or not any(parts):
        raise argparse.ArgumentTypeError(f"{text!r} must be A:B, for example 2:30, 2: or :30")
    low, high = (_number(part) if part else None for part in parts)
    if (low or 0.0) < 0.0 or (high is not None and high <= (low or 0.0)):
        raise argparse.ArgumentTypeError(f"{text!r} must have 0 <= A < B")
    return low, high


@dataclass(frozen=True)
class Flag:
    """One option of the command line, which sets a field of `Settings` and has its description.

    Attributes
    ----------
    name : str
    field : str
    how : mapping
        For `argparse`.
    """

    name: str
    field: str
    how: Mapping[str, Any]


READING = (
    Flag("--columns", "columns", {"metavar": "MAP"}),
    Flag("--period-s", "period_s", {"type": positive, "metavar": "T"}),
    Flag("--encoder-resolution", "encoder_resolution", {"type": positive, "metavar": "Q"}),
    Flag("--rows", "rows", {"type": span, "metavar": "A:B"}),
    Flag("--seconds", "seconds", {"type": span, "metavar": "A:B"}),
    Flag("--allow-outside", "allow_outside", {"action": "store_true"}),
)
ANALYSIS = (
    Flag("--model", "model", {"choices": MODELS}),
    Flag("--device", "device", {"metavar": "NAME"}),
    Flag("--delay-s", "delay_s", {"type": non_negative, "metavar": "SECONDS"}),
    Flag("--delay-sd-s", "delay_sd_s", {"type": non_negative, "metavar": "SECONDS"}),
    Flag("--band", "band_hz", {"type": band, "metavar": "LOW,HIGH"}),
    Flag("--held", "held", {"type": yes_or_no, "metavar": "yes|no"}),
    Flag("--modes", "modes", {"type": whole, "metavar": "N"}),
    Flag("--loop", "close_loop", {"action": argparse.BooleanOptionalAction}),
    Flag("--hidden", "hidden", {"type": yes_or_no, "metavar": "yes|no"}),
    Flag("--budget", "budget_s", {"type": positive, "metavar": "SECONDS"}),
    Flag("--seed", "seed", {"type": whole, "metavar": "N"}),
)
_NOT_BOTH = ("rows", "seconds")


def add_analysis_options(parser: argparse.ArgumentParser) -> None:
    """The options that say how recordings are read and analysed."""
    said = descriptions(Options) | descriptions(Settings)
    for title, flags in (("read", READING), ("analysed", ANALYSIS)):
        group = parser.add_argument_group(f"how the recording is {title}")
        part = group.add_mutually_exclusive_group() if flags is READING else group
        for flag in flags:
            (part if flag.field in _NOT_BOTH else group).add_argument(
                flag.name,
                dest=flag.field,
                default=argparse.SUPPRESS,
                help=said.get(flag.field),
                **flag.how,
            )


def settings_from(arguments: argparse.Namespace) -> Settings:
    """What `add_analysis_options` understood, as one thing."""
    given = (flag.field for flag in (*READING, *ANALYSIS) if hasattr(arguments, flag.field))
    return Settings(**{field: getattr(arguments, field) for field in given})


def descriptions(kind: type) -> dict[str, str]:
    """What the docstring of a class says of each attribute, as help: lower case, no full stop."""
    title = "Attributes\n----------\n"
    said = inspect.cleandoc(kind.__doc__ or "")
    if title not in said:  # ``python -OO`` leaves the docstring in the source alone
        said = _docstring_in_source(kind)
    _, _, attributes = said.partition(title)
    found: dict[str, list[str]] = {}
    names: list[str] = []
    for line in attributes.splitlines():
        if line.startswith(" "):
            for name in names:
                found[name].append(line.strip())
        else:
            names = line.partition(" :")[0].split(", ")
            found |= {name: [] for name in names}
    return {name: _as_help(" ".join(lines)) for name, lines in found.items()}


def _docstring_in_source(kind: type) -> str:
    (written,) = ast.parse(inspect.getsource(kind)).body
    return isinstance(written, ast.ClassDef) and ast.get_docstring(written) or ""


def _as_help(text: str) -> str:
    return text[:1].lower() + text[1:].rstrip(".").replace("%", "%%")


def add_workers(parser: argparse.ArgumentParser) -> None:
    """--workers, for the recordings of a study."""
    parser.add_argument(
        "--workers",
        type=count,
        metavar="N",
        help="processes for the recordings of a study (default: one for each usable core)",
    )


def workers_from(arguments: argparse.Namespace) -> int:
    """How many processes to use."""
    from bayeshaptic.jobs.executors import usable_cores

    return arguments.workers or usable_cores()


def command_line() -> str:
    """The command that runs, for a report's provenance."""
    import shlex
    import sys

    return shlex.join(["bayeshaptic", *sys.argv[1:]])


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """--quiet."""
    parser.add_argument(
        "--quiet", action="store_true", help="no progress and no summary; errors still show"
    )


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number") from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} must be finite")
    return value
