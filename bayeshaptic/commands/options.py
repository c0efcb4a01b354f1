"""Options and argument types that several commands share."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING

from bayeshaptic.numerics.spending import BUDGET_S

if TYPE_CHECKING:
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


def seed(text: str) -> int:
    """A whole number, zero or above."""
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"{text!r} must be a whole number, zero or above")
    return int(text)


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


def span(text: str) -> tuple[float | None, float | None]:
    """``A:B`` with 0 <= A < B, either of which may be left out."""
    parts = text.split(":")
    if len(parts) != 2 or not any(parts):
        raise argparse.ArgumentTypeError(f"{text!r} must be A:B, for example 2:30, 2: or :30")
    low, high = (_number(part) if part else None for part in parts)
    if (low or 0.0) < 0.0 or (high is not None and high <= (low or 0.0)):
        raise argparse.ArgumentTypeError(f"{text!r} must have 0 <= A < B")
    return low, high


def add_analysis_options(parser: argparse.ArgumentParser) -> None:
    """The options that say how recordings are read and analysed."""
    reading = parser.add_argument_group("how the recording is read")
    reading.add_argument(
        "--columns",
        metavar="MAP",
        help="which columns, variables or datasets hold time, force and position, with scale "
        "factors and units (N, Nm, A; m, rad), where they are not called as above; "
        "for example time=t*1e-6,force=u[A],position=q[rad]",
    )
    reading.add_argument(
        "--period-s",
        type=positive,
        metavar="T",
        help="sampling period in seconds (default: from the time stamps)",
    )
    reading.add_argument(
        "--encoder-resolution",
        type=positive,
        metavar="Q",
        help="one encoder count, in m or rad (default: from the device, or from the data)",
    )
    part = reading.add_mutually_exclusive_group()
    part.add_argument(
        "--rows",
        type=span,
        metavar="A:B",
        help="read rows A to B only, counted from 1; either may be left out",
    )
    part.add_argument(
        "--seconds",
        type=span,
        metavar="A:B",
        help="read from A to B seconds after the first row only; either may be left out",
    )
    reading.add_argument(
        "--allow-outside",
        action="store_true",
        help="let a study read files outside its own folder",
    )
    analysis = parser.add_argument_group("how it is analysed")
    analysis.add_argument(
        "--model",
        choices=MODELS,
        default="auto",
        help="mechanism to fit: one mass, two masses, or three with a user's hand (default: auto, "
        "chosen from the data, and the report says why)",
    )
    analysis.add_argument(
        "--device",
        metavar="NAME",
        help="device file with priors and delay: lhifam, phantom, or the path of a TOML file "
        "(default: what the recording or the study names, or no device)",
    )
    analysis.add_argument(
        "--delay-s",
        type=non_negative,
        metavar="SECONDS",
        help="loop delay, beyond the hold (default: the device's, or inferred)",
    )
    analysis.add_argument(
        "--delay-sd-s",
        type=non_negative,
        metavar="SECONDS",
        help="standard deviation of --delay-s (default: the device's; 0 means known exactly)",
    )
    analysis.add_argument(
        "--band",
        type=band,
        metavar="LOW,HIGH",
        help="frequencies used, in Hz (default: chosen from the data)",
    )
    analysis.add_argument(
        "--held",
        choices=("yes", "no"),
        help="whether somebody held the device: then the base model is chosen among those of held, "
        "or of free, devices (default: from the data; of a study, from its users)",
    )
    analysis.add_argument(
        "--no-loop",
        action="store_true",
        help="take the model as it is, without looking for what it lacks: quicker, and the limit "
        "may be far off where something is missing",
    )
    analysis.add_argument(
        "--budget",
        type=positive,
        default=BUDGET_S,
        metavar="SECONDS",
        help="what looking for what the model lacks may cost, in nominal seconds: evaluations are "
        "counted, so that the verdict is the same on every machine (default: %(default)g)",
    )
    analysis.add_argument(
        "--seed",
        type=seed,
        default=0,
        metavar="N",
        help="seed of the sampler: the same seed gives the same report (default: 0)",
    )


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


def settings_from(arguments: argparse.Namespace) -> Settings:
    """What `add_analysis_options` understood, as one thing."""
    from bayeshaptic.jobs.job import Settings

    return Settings(
        columns=arguments.columns,
        period_s=arguments.period_s,
        encoder_resolution=arguments.encoder_resolution,
        model=arguments.model,
        device=arguments.device,
        delay_s=arguments.delay_s,
        delay_sd_s=arguments.delay_sd_s,
        band_hz=arguments.band,
        seed=arguments.seed,
        budget_s=arguments.budget,
        close_loop=not arguments.no_loop,
        held=None if arguments.held is None else arguments.held == "yes",
        allow_outside=arguments.allow_outside,
        rows=arguments.rows,
        seconds=arguments.seconds,
    )


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
