"""What to do where a page recommends no stiffness: the remedy, and the exact next command."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.base.high_passed import TOPIC as HIGH_PASSED
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.numerics.spending import BUDGET_S
from bayeshaptic.recordings.checks.against_device import says_the_mass
from bayeshaptic.recordings.checks.check import USUAL_SECONDS
from bayeshaptic.recordings.checks.loop_period import rows_are_uneven
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.checks.units_in_doubt import in_doubt
from bayeshaptic.recordings.feedback import has_feedback, is_certain
from bayeshaptic.report.beyond_band import beyond_band
from bayeshaptic.report.numbers.result import is_unexplained, may_be_held, said_who_holds
from bayeshaptic.report.numbers.stand_ins import is_the_rest, not_tried
from bayeshaptic.report.numbers.stiffest import too_stiff
from bayeshaptic.report.objections import changes, is_open

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.report.headline import Headline


@dataclass(frozen=True)
class Step:
    """Something to do.

    Attributes
    ----------
    text : str
        A sentence, or two.
    command : str
        As it is typed; NEW.csv is the recording still to be made.
    """

    text: str
    command: str


# What is said of how the file is read, and of the device: the next report needs it, too.
_KEPT = ("columns", "period_s", "delay_s", "encoder_resolution", "held")
_LONGER = 5.0  # times the budget of a search that was not enough
_NOT_ONE_MASS = (
    "Or ask whether it is another device: one mass, as was declared, does not explain this motion. "
    "Without --model rigid those of two masses, free and held, are tried. This recording will do:"
)


def next_steps(
    head: Headline, result: Result, origin: Mapping[str, Any] | None = None
) -> tuple[Step, ...]:
    """What to do, the best first; empty where a stiffness is recommended.

    Parameters
    ----------
    head : Headline
    result : Analysis or Closed
    origin : mapping, optional
        What `bayeshaptic.provenance` gives, for the options that the next command needs as well.
    """
    if head.status != "untrusted":
        return ()
    options = (origin or {}).get("options") or {}
    device = _device(result) + _said(options, _KEPT)
    analysis, command = result.analysis, f"bayeshaptic report {_source(result)}{device}"
    new = f"bayeshaptic report NEW.csv{device}"
    if rows_are_uneven(analysis.notices):
        return _after_uneven_rows(result, command, new)
    if has_feedback(analysis.notices):
        if options.get("model") == "rigid":
            return _in_open_loop(new), Step(_NOT_ONE_MASS, command)
        through = f"bayeshaptic report {_source(result)}{_device(result)}"
        return _after_feedback(result, command, new, through + _said(options, _KEPT[1:]))
    doubted = any(in_doubt(what, analysis.notices) for what in ("position", "time"))
    if doubted or (analysis.sampled and too_stiff(analysis) is not None):
        return _after_doubtful_units(result, options)
    if (too_little := told_too_little(analysis.notices)) is not None:
        cure = too_little.cure[0].upper() + too_little.cure[1:]
        return (Step(f"{cure}. Then:", new),)
    if analysis.etfe.through_reference:
        return _after_reference(result, command, new)
    if analysis.etfe.direct and analysis.posterior.converged:
        return (_in_open_loop(new),)
    if any(notice.topic == HIGH_PASSED for notice in analysis.notices):
        return _after_filter(result, command, new)
    if result.closed is not None and not_tried(result.closed):
        budget = float(options.get("budget") or BUDGET_S)
        more = f"{command} --budget {_LONGER * budget:.0f}"
        return (Step("Let the search for forces go on. This recording will do:", more),)
    return (_after_fit(result, command, new),)


def _after_doubtful_units(result: Result, options: Mapping[str, Any]) -> tuple[Step, ...]:
    """Where a number is one that no device has: another unit, or a device that says so."""
    model = result.analysis.model
    force, position = model.force_unit, model.position_unit
    source, kept = f"bayeshaptic report {_source(result)}", _said(options, _KEPT[1:])
    columns = f"time=NAME[s],force=NAME*0.01[{force}],position=NAME*3.1e-6[{position}]"
    if result.measured.recording is None:
        columns = f"gain_db=NAME[{position}/{force}]"
    units = Step(
        "Say in which units they are, with the size of a count where they are counts. This "
        "recording will do:",
        f'{source}{_device(result)}{kept} --columns "{columns}"',
    )
    notices = result.analysis.notices
    of_the_time = in_doubt("time", notices) and not in_doubt("position", notices)
    if of_the_time or says_the_mass(result.measured.device):
        return (units,)
    unit, kind = ("kg m^2", "rotational") if position == "rad" else ("kg", "translational")
    table = f'name = "mine", kind = "{kind}" and [rigid] m = its mass in {unit}'
    return units, Step(
        "Or, if the units are right, confirm them by the mass, in a device file (MINE.toml: "
        f"{table}, a line each):",
        f"{source} --device MINE.toml{_said(options, _KEPT)}",
    )


def _after_uneven_rows(result: Result, command: str, new: str) -> tuple[Step, ...]:
    """Where a log may have written the newest rows of a loop of another rate."""
    recording = result.measured.recording
    every = Step("Write every row of the loop down, at the loop's own rate. Then:", new)
    if recording is None:
        return (every,)
    alone = Step(
        "Or say so, if the loop does run at every row, and the sensor of the position alone has "
        "another clock. This recording will do:",
        f"{command} --period-s {recording.period_s:.6g}",
    )
    return every, alone


def _after_filter(result: Result, command: str, new: str) -> tuple[Step, ...]:
    """Where the position may have been high-passed before it was written down."""
    unfiltered = Step("Record the position as it is read, and leave its drift in it. Then:", new)
    if said_who_holds(result.analysis):
        return (unfiltered,)
    held = Step(
        "Or say so, if somebody held the device and nothing was filtered. This recording will do:",
        f"{command} --held yes",
    )
    return unfiltered, held


def _after_fit(result: Result, command: str, new: str) -> Step:
    """Where the recording will do, and what came of it will not."""
    analysis = result.analysis
    if not analysis.posterior.converged:
        return _not_converged(analysis, command)
    if is_open(analysis):
        return Step(
            "Let the force be larger and slower, or record longer, so that the device moves as "
            "far as it will in use; or say what is known of its dampers in a device file, "
            "--device. Then:",
            new,
        )
    if result.closed is None:
        return Step("Let the loop look for what the model lacks (leave out --no-loop):", command)
    if is_the_rest(result.closed):
        return Step(
            "Let the force be two or three times as strong, so that friction is a small part of "
            "it. Then:",
            new,
        )
    if changes(result.closed):
        grip = ", hold it alike all the time" if analysis.model.held else ""
        return Step(
            f"Let the device warm up{grip}, and record some {USUAL_SECONDS} s of a force that does "
            "not repeat: in parts of that a change can be followed. Then:",
            new,
        )
    if beyond_band(result.closed) is not None:
        return Step(
            "Let the force move the device at the limit's frequency, too, so that the band that "
            "was measured holds the limit. Then:",
            new,
        )
    if is_unexplained(result):
        alone = ", and with nobody holding the device" if may_be_held(analysis) else ""
        return Step(
            f"Record at half and at twice the force{alone}. What changes tells which part of "
            "it the model lacks. Compare the reports:",
            "bayeshaptic batch FOLDER -o reports",
        )
    return Step(
        "Try another base model (--model free, --model grasped) or another band (--band "
        "LOW,HIGH), and see whether the misfit goes:",
        f"{command} --model free",
    )


def _not_converged(analysis: Analysis, command: str) -> Step:
    """Where the chains of the sampler do not agree."""
    seed = f"--seed {analysis.posterior.seed + 1}"
    # A spring to the ground, as of a joystick, may pass for a hand, which leaves more peaks.
    if analysis.model.held and not said_who_holds(analysis):
        return Step(
            "Say so, if nobody holds the device. Else let the sampler begin elsewhere "
            f"({seed}), and tell it what is known of the device (--device, --delay-s):",
            f"{command} --held no",
        )
    return Step(
        "Let the sampler begin elsewhere, and tell it what is known of the device "
        "(--device, --delay-s):",
        f"{command} {seed}",
    )


def _after_feedback(result: Result, command: str, new: str, bare: str) -> tuple[Step, ...]:
    """Where the force was computed from the motion."""
    analysis = result.analysis
    again = _in_open_loop(new)
    if analysis.in_loop is None or analysis.in_loop.doubts:
        given = any(notice.topic == "reference" for notice in analysis.notices)
        return (again, _through(bare)) if is_certain(analysis.notices) and not given else (again,)
    rigid = "Or, where the device is known to be one rigid mass, say so. This recording will do:"
    return again, Step(rigid, f"{command} --model rigid")


def _after_reference(result: Result, command: str, new: str) -> tuple[Step, ...]:
    """Where the response was read through what a controller followed."""
    analysis = result.analysis
    if analysis.model.held:
        text = (
            "Record in open loop (a force that comes from a table) or, where the loop must stay "
            "closed, with white noise added to the controller's command. Then:"
        )
        return (Step(text, new),)
    free = Step("Where nobody holds the device, say so:", f"{command} --held no")
    return (
        *((free,) if may_be_held(analysis) else ()),
        Step(
            "Record again with a reference of white noise that keeps the device moving, with white "
            "noise added to the command, or in open loop, where friction can be told from the "
            "rest. Then:",
            new,
        ),
    )


def _in_open_loop(new: str) -> Step:
    return Step(
        "Record again with a force that does not depend on the motion (white noise, or a "
        "multisine) or, where the loop must stay closed, with white noise added to the command. "
        "Then report on that recording:",
        new,
    )


def _through(command: str) -> Step:
    return Step(
        "Or tell what the controller followed: declare it in [feedback] of a study, or write its "
        "reference beside the force and name that column:",
        f"{command} --columns time=NAME,force=NAME,position=NAME,reference=NAME",
    )


def _source(result: Result) -> str:
    recording = result.measured.recording
    if recording is None or recording.source is None:
        return "RECORDING"
    return shlex.quote(recording.source.name)


def _said(options: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """Options as they were given, those that were not left out."""
    words = {True: "yes", False: "no"}
    given = {name: options.get(name) for name in names}
    return "".join(
        f" --{name.replace('_', '-')} "
        + (words[value] if isinstance(value, bool) else shlex.quote(str(value)))
        for name, value in given.items()
        if value is not None
    )


def _device(result: Result) -> str:
    device = result.measured.device
    return "" if device is None else f" --device {device.name}"
