"""What to do where a page recommends no stiffness: the remedy, and the exact next command."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.report.numbers.result import is_unexplained

if TYPE_CHECKING:
    from bayeshaptic.report.headline import Headline


def next_step(head: Headline, result: Result) -> str:
    """A sentence or two; empty where a stiffness is recommended."""
    if head.status != "untrusted":
        return ""
    analysis, command = result.analysis, _command(result)
    if has_feedback(analysis.notices):
        again = (
            "Record again with a force that does not depend on the motion (white noise or a "
            f"multisine), and report on that recording: {command}"
        )
        if analysis.in_loop is None or analysis.in_loop.doubts:
            return again
        return (
            f"{again}. Where the device is known to be one rigid mass, say so, and this recording "
            f"will do: {command} --model rigid"
        )
    if not analysis.posterior.converged:
        return (
            "Let the sampler begin elsewhere, and tell it what is known of the device "
            f"(--device, --delay-s): {command} --seed {analysis.posterior.seed + 1}"
        )
    if result.closed is None:
        return f"Let the loop look for what the model lacks: {command}, without --no-loop."
    if is_unexplained(result):
        return (
            "Record at half and at twice the force, and with nobody holding the device: what "
            "changes tells which part of it the model lacks. Then compare the reports: "
            "bayeshaptic batch *.csv"
        )
    return (
        "Try another base model (--model free, --model grasped) or another band (--band LOW,HIGH) "
        f"and see whether the misfit goes: {command} --model free"
    )


def _command(result: Result) -> str:
    analysis = result.measured
    recording = analysis.recording
    source = "RECORDING" if recording is None or recording.source is None else recording.source.name
    device = "" if analysis.device is None else f" --device {analysis.device.name}"
    return f"bayeshaptic report {source}{device}"
