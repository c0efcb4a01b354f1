"""``bayeshaptic relay``: gain margin and frequency from a relay experiment."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from bayeshaptic.commands.options import add_quiet, positive
from bayeshaptic.errors import InputError

if TYPE_CHECKING:
    from bayeshaptic.stability.relay.check import RelayCheck
    from bayeshaptic.stability.relay.measurement import RelayMeasurement

NAME = "relay"
SUMMARY = "measure gain margin and frequency from a relay recording"
DESCRIPTION = """\
Read the gain margin off a relay experiment (force = -h sign(position)): the frequency from the
averaged power spectral density in steady state, the gain from the ratio of force and position
there. A relay that switches at samples settles a few degrees beside the phase of -180 degrees;
where the recording shows how the response goes on, the critical stiffness is read at the crossing
itself. With --device, a device file's prediction stands beside it."""
EXAMPLES = """\
  bayeshaptic relay phantom-user-relay.csv.gz
  bayeshaptic relay phantom-user-relay.csv.gz --device phantom --model grasped"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The recording, how to read it, and a device to compare with."""
    parser.add_argument(
        "recording",
        type=Path,
        metavar="RECORDING",
        help="force and position of the loop closed through the relay (.csv, .csv.gz, .mat, .h5, "
        ".npz)",
    )
    parser.add_argument(
        "--columns",
        metavar="MAP",
        help="which columns hold time, force and position, as in `bayeshaptic report`",
    )
    parser.add_argument(
        "--period-s",
        type=positive,
        metavar="T",
        help="sampling period in seconds (default: from the time stamps)",
    )
    parser.add_argument(
        "--device", metavar="NAME", help="device file to compare with: lhifam, phantom, or a path"
    )
    parser.add_argument(
        "--model",
        choices=("rigid", "free", "grasped"),
        help="which of the models of --device (default: grasped, somebody holds the device)",
    )
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the measurement; 0."""
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.faq import explained
    from bayeshaptic.models import build_model
    from bayeshaptic.recordings.measurement import read_measurement
    from bayeshaptic.recordings.recording import Recording
    from bayeshaptic.stability.relay.check import check_relay
    from bayeshaptic.stability.relay.measure import measure_relay

    if arguments.model and not arguments.device:
        raise InputError("--model names a device file's model; give --device, too")
    recording = read_measurement(arguments.recording, arguments.columns, arguments.period_s)
    if not isinstance(recording, Recording):
        raise InputError(
            f"{arguments.recording}: a table of a frequency response, not a relay recording"
        )
    measured = measure_relay(recording)
    with Talk(arguments.quiet) as talk:
        for line in measured_lines(recording.name, measured):
            talk.say(line)
        if arguments.device:
            model = build_model(arguments.model or "grasped", arguments.device)
            model = model.with_period(recording.period_s)
            for line in check_lines(check_relay(measured, model), measured.unit):
                talk.say(line)
        for notice in measured.notices:
            talk.say(f"  {notice.level}: {explained(notice)}")
    return 0


def measured_lines(name: str, measured: RelayMeasurement) -> list[str]:
    """The measurement in a few lines."""
    lines = [
        f"{name}: oscillates at {measured.frequency_hz:.2f} ± {measured.frequency_sd_hz:.2f} Hz; "
        f"gain margin {_stiffness(measured.gain_margin, measured.unit)}, "
        f"± {measured.gain_margin_sd_db:.2f} dB, at {measured.phase_deg:+.1f}° from -180°"
    ]
    if measured.critical_stiffness is not None:
        lines.append(
            f"  critical stiffness {_stiffness(measured.critical_stiffness, measured.unit)}, "
            f"± {measured.critical_sd_db:.2f} dB, at {measured.crossing_hz:.2f} Hz, "
            "where the phase is -180°"
        )
    return lines


def check_lines(check: RelayCheck, unit: str) -> list[str]:
    """The prediction beside it."""
    lines = [
        f"  predicted: critical stiffness {_stiffness(check.critical_stiffness, unit)} at "
        f"{check.binding_hz:.2f} Hz",
        f"  at the relay's own frequency: {_stiffness(check.predicted, unit)}, measured "
        f"{check.difference_db:+.2f} dB beside it",
    ]
    if not check.binds:
        lines.append(
            f"  the relay settled on another crossing: {check.settled_on}, "
            f"{_stiffness(check.settled_stiffness, unit)}; it says nothing of the one that binds"
        )
    return lines


def _stiffness(value: float, unit: str) -> str:
    from math import log10

    return f"{value:.5g} {unit} ({20 * log10(value):.2f} dB)"
