"""``bayeshaptic simulate``: a recording from the virtual bench."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.commands.options import add_quiet, band, non_negative, place, positive, whole
from bayeshaptic.errors import InputError, refuse_place

if TYPE_CHECKING:
    from bayeshaptic.rig.bench import Bench
    from bayeshaptic.rig.excitation import Excitation
    from bayeshaptic.rig.recording import SimulatedRecording

NAME = "simulate"
SUMMARY = "record a simulated device, with or without a hand on it"
DESCRIPTION = """\
Record a simulated experiment: a device of known parameters, perhaps held by a user whose hand
trembles and wanders, is shaken by a commanded force and read by an encoder. The truth is known, so
this is how to try the report, and how well it finds what is there."""
EXAMPLES = """\
  bayeshaptic simulate lhifam --held -o lhifam-user.csv.gz
  bayeshaptic simulate phantom --excitation multisine --seconds 20 -o multisine.npz
  bayeshaptic simulate lhifam --held --excitation relay -o relay.csv.gz
  bayeshaptic simulate out/posterior.nc --seed 7 -o again.csv.gz
  bayeshaptic simulate lhifam --effect coulomb_friction=force:1.5 -o rubbing.csv"""


OPTIONS: dict[str, dict[str, Any]] = {
    "--seconds": {
        "type": positive,
        "default": 30.0,
        "metavar": "S",
        "help": "duration (default: 30)",
    },
    "--period-s": {
        "type": positive,
        "metavar": "T",
        "help": "sampling period (default: the device's)",
    },
    "--delay-s": {
        "type": non_negative,
        "metavar": "SECONDS",
        "help": "loop delay (default: the device's)",
    },
    "--encoder-resolution": {
        "type": positive,
        "metavar": "Q",
        "help": "one encoder count, in m or rad (default: the device's)",
    },
    "--excitation": {
        "choices": ("noise", "multisine", "chirp", "prbs", "step", "relay"),
        "default": "noise",
        "help": "white noise in the band, a multisine with lines 1 Hz apart, a chirp through the "
        "band, a pseudo-random binary sequence, steps twice a second, or a relay experiment, force "
        "= -F sign(position) (default: noise)",
    },
    "--hysteresis": {
        "type": non_negative,
        "default": 0.0,
        "metavar": "Q",
        "help": "of the relay: it switches where the position has passed zero by so much, in m or "
        "rad (default: 0)",
    },
    "--force-rms": {
        "type": positive,
        "metavar": "F",
        "help": "root mean square of the excitation, N or N m; of a relay that is its F (default: "
        "what is usual for the device, three times that for a relay)",
    },
    "--band": {
        "type": band,
        "metavar": "LOW,HIGH",
        "help": "of the excitation, in Hz (default: the device's)",
    },
    "--effect": {
        "action": "append",
        "default": [],
        "metavar": "NAME[=FIELD:VALUE,...]",
        "help": "something that the plain model lacks, at a typical strength or with the fields "
        "given; may come more than once. An unknown name or field lists the known ones",
    },
    "--from-prior": {
        "action": "store_true",
        "help": "of a posterior.nc: draw from the priors of its model instead",
    },
    "--seed": {
        "type": whole,
        "default": 0,
        "metavar": "N",
        "help": "the same seed gives the same recording (default: 0)",
    },
    "--force": {"action": "store_true", "help": "overwrite FILE where it exists"},
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The device, the file, and what is simulated."""
    parser.add_argument(
        "device",
        metavar="DEVICE",
        help="lhifam, phantom, the path of a device file (TOML), or a report's posterior.nc, of "
        "which a draw is taken",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=place,
        required=True,
        metavar="FILE",
        help="the recording: .csv, .csv.gz, .npz, .h5 or .mat",
    )
    hand = parser.add_mutually_exclusive_group()
    hand.add_argument("--held", action="store_true", default=None, help="a user holds the device")
    hand.add_argument(
        "--free",
        dest="held",
        action="store_false",
        default=None,
        help="nobody holds it (the default)",
    )
    for name, how in OPTIONS.items():
        parser.add_argument(name, **how)
    add_quiet(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the recording; 0."""
    from bayeshaptic.commands.talk import Talk
    from bayeshaptic.rig.recording import write_recording

    refuse_place(arguments.output, "recording.csv.gz")
    if arguments.output.exists() and not arguments.force:
        raise InputError(
            f"{arguments.output} exists; name another file, or overwrite it with --force"
        )
    bench = bench_from(arguments)
    recording = record(arguments, bench)
    path = write_recording(arguments.output, recording)
    with Talk(arguments.quiet) as talk:
        talk.say(
            f"{path}: {len(recording.time_s)} samples every {1e3 * recording.period_s:g} ms; "
            f"truth: {bench.mechanism}, critical stiffness {bench.true_critical_stiffness():.5g} "
            f"{'N/m' if bench.force_unit == 'N' else 'N m/rad'}"
        )
    return 0


def record(arguments: argparse.Namespace, bench: Bench) -> SimulatedRecording:
    """The experiment on the bench: an excitation in open loop, or a relay."""
    from bayeshaptic.rig.loops import run_relay
    from bayeshaptic.rig.simulate import simulate

    if arguments.band and arguments.excitation in ("relay", "step"):
        raise InputError(f"--band is for other excitations: a {arguments.excitation} has none")
    if arguments.excitation == "relay":
        return run_relay(
            bench,
            arguments.force_rms,
            arguments.seconds,
            arguments.hysteresis,
            seed=arguments.seed,
        )
    if arguments.hysteresis:
        raise InputError("--hysteresis is a relay's; add --excitation relay")
    return simulate(bench, excitation_from(arguments, bench), seed=arguments.seed)


def bench_from(arguments: argparse.Namespace) -> Bench:
    """The bench that the options describe."""
    from bayeshaptic.recordings.response.band import refuse_band
    from bayeshaptic.rig.bench import Bench

    options = {
        "period_s": arguments.period_s,
        "delay_s": arguments.delay_s,
        "encoder_resolution": arguments.encoder_resolution,
        "force_rms": arguments.force_rms,
        "band_hz": arguments.band,
    }
    changes = {name: value for name, value in options.items() if value is not None}
    if arguments.device.lower().endswith(".nc"):
        from bayeshaptic.commands.drawn import drawn_device

        if arguments.held is not None:
            raise InputError("--held and --free are for a device: a posterior.nc says who holds it")
        path = Path(arguments.device)
        device, mechanism = drawn_device(path, arguments.seed, arguments.from_prior)
        bench = Bench.from_device(device, mechanism=mechanism, **changes)
    else:
        if arguments.from_prior:
            raise InputError("--from-prior is for a posterior.nc, whose model has the priors")
        bench = Bench.from_device(arguments.device, held=bool(arguments.held), **changes)
    for text in arguments.effect:
        name, fields = parse_effect(text)
        bench = bench.with_effect(name, **fields)
    refuse_band(arguments.band, bench.period_s)
    return bench


def excitation_from(arguments: argparse.Namespace, bench: Bench) -> Excitation:
    """The excitation, of the bench's level and band."""
    from bayeshaptic.rig.excitation import BinaryNoise, Chirp, Multisine, Steps, WhiteNoise

    (low, high), rms, seconds = bench.band_hz, bench.force_rms, arguments.seconds
    if arguments.excitation == "noise":
        return WhiteNoise(rms, high, low, seconds)
    if arguments.excitation == "chirp":
        return Chirp(rms, low, high, seconds)
    if arguments.excitation == "prbs":
        return BinaryNoise(rms, high, seconds)
    if arguments.excitation == "step":
        return Steps(rms, seconds=seconds)
    periods = max(round(seconds), 1)
    return Multisine(rms, low, high, spacing_hz=1.0, periods=periods)


def parse_effect(text: str) -> tuple[str, dict[str, float]]:
    """``name=field:value,field:value`` as the name and the fields' values.

    Raises
    ------
    InputError
        Where a field has no value, or one that is not a number.
    """
    name, _, rest = text.partition("=")
    fields: dict[str, float] = {}
    for part in filter(None, rest.split(",")):
        key, colon, value = part.partition(":")
        try:
            fields[key.strip()] = float(value)
        except ValueError:
            raise InputError(
                f"--effect {text}: '{part}' is not FIELD:VALUE with a number, for example force:1.5"
            ) from None
    return name.strip(), fields
