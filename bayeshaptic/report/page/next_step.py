"""What to do where a page recommends no stiffness: the remedy, and the exact next command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.diagnosis.trials.drift import PARTS
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.feedback import has_feedback, is_certain
from bayeshaptic.recordings.sufficiency import SHORTEST_S, told_too_little
from bayeshaptic.report.numbers.result import is_unexplained, may_be_held
from bayeshaptic.report.objections import changes, is_open

if TYPE_CHECKING:
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


def next_steps(head: Headline, result: Result) -> tuple[Step, ...]:
    """What to do, the best first; empty where a stiffness is recommended."""
    if head.status != "untrusted":
        return ()
    analysis, command = result.analysis, _command(result)
    if has_feedback(analysis.notices):
        return _after_feedback(result, command)
    if (too_little := told_too_little(analysis.notices)) is not None:
        cure = too_little.cure[0].upper() + too_little.cure[1:]
        return (Step(f"{cure}. Then:", f"bayeshaptic report NEW.csv{_device(result)}"),)
    if analysis.etfe.through_reference:
        return _after_reference(result, command)
    if not analysis.posterior.converged:
        return (
            Step(
                "Let the sampler begin elsewhere, and tell it what is known of the device "
                "(--device, --delay-s):",
                f"{command} --seed {analysis.posterior.seed + 1}",
            ),
        )
    if is_open(analysis):
        return (
            Step(
                "Let the force be larger and slower, or record longer, so that the device moves as "
                "far as it will in use; or say what is known of its dampers in a device file, "
                "--device. Then:",
                f"bayeshaptic report NEW.csv{_device(result)}",
            ),
        )
    if result.closed is None:
        return (Step("Let the loop look for what the model lacks (leave out --no-loop):", command),)
    if changes(result.closed):
        grip = ", hold it alike all the time" if analysis.model.held else ""
        return (
            Step(
                f"Let the device warm up{grip}, and record at least "
                f"{pure(PARTS * SHORTEST_S)} s of a force that does not repeat: in that a change "
                "can be followed. Then:",
                f"bayeshaptic report NEW.csv{_device(result)}",
            ),
        )
    if is_unexplained(result):
        alone = ", and with nobody holding the device" if may_be_held(analysis) else ""
        return (
            Step(
                f"Record at half and at twice the force{alone}. What changes tells which part of "
                "it the model lacks. Compare the reports:",
                "bayeshaptic batch FOLDER -o reports",
            ),
        )
    return (
        Step(
            "Try another base model (--model free, --model grasped) or another band (--band "
            "LOW,HIGH), and see whether the misfit goes:",
            f"{command} --model free",
        ),
    )


def _after_feedback(result: Result, command: str) -> tuple[Step, ...]:
    """Where the force was computed from the motion."""
    analysis = result.analysis
    again = Step(
        "Record again with a force that does not depend on the motion: white noise, or a "
        "multisine. Then report on that recording:",
        f"bayeshaptic report NEW.csv{_device(result)}",
    )
    if analysis.in_loop is None or analysis.in_loop.doubts:
        given = any(notice.topic == "reference" for notice in analysis.notices)
        return (again, _through(result)) if is_certain(analysis.notices) and not given else (again,)
    rigid = "Or, where the device is known to be one rigid mass, say so. This recording will do:"
    return again, Step(rigid, f"{command} --model rigid")


def _after_reference(result: Result, command: str) -> tuple[Step, ...]:
    """Where a controller's reference was followed."""
    analysis = result.analysis
    new = f"bayeshaptic report NEW.csv{_device(result)}"
    if analysis.model.held:
        return (Step("Record in open loop: a force that comes from a table. Then:", new),)
    free = Step("Where nobody holds the device, say so:", f"{command} --held no")
    return (
        *((free,) if may_be_held(analysis) else ()),
        Step(
            "Record again with a reference of white noise that keeps the device moving, or in "
            "open loop, where friction can be told from the rest. Then:",
            new,
        ),
    )


def _through(result: Result) -> Step:
    return Step(
        "Or tell what the controller followed: declare it in [feedback] of a study, or write its "
        "reference beside the force and name that column:",
        f"{_command(result)} --columns time=NAME,force=NAME,position=NAME,reference=NAME",
    )


def _command(result: Result) -> str:
    recording = result.measured.recording
    source = "RECORDING" if recording is None or recording.source is None else recording.source.name
    return f"bayeshaptic report {source}{_device(result)}"


def _device(result: Result) -> str:
    device = result.measured.device
    return "" if device is None else f" --device {device.name}"
