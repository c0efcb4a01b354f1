"""`report.html`: one file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.errors import unique
from bayeshaptic.recordings.from_columns import recording_name
from bayeshaptic.report import tables, words
from bayeshaptic.report.assumptions import assumptions, priors
from bayeshaptic.report.figures.pictures import FORCE_PICTURES, LOOP_PICTURES, PICTURES
from bayeshaptic.report.figures.style import Drawn
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop import (
    change_words,
    force_words,
    tables as loop_tables,
    words as loop_words,
)
from bayeshaptic.report.loop.motion_words import motion_words
from bayeshaptic.report.numbers.trust import doubtful_parameters
from bayeshaptic.report.numbers.unstated import unstated
from bayeshaptic.report.page import answer, methods
from bayeshaptic.report.page.frame import LABELS, embedded, finished, frame, template
from bayeshaptic.report.page.lights import lights
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.report.page.reproduce import asked, reproduce

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

FILES = (
    ("summary.json", "the numbers of this page"),
    ("limits.json", "stable walls, for a rendering program"),
    ("limits.csv", "the same as a table"),
    ("posterior.nc", "the draws, for ArviZ"),
)
_SHOWN = {p.name: p.alternative for p in (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES)}
_CONTENTS = (
    ("summary", "Summary"),
    ("limit", "Limit"),
    ("walls", "Walls"),
    ("response", "Response"),
    ("lacked", "What the model lacked"),
    ("force", "Force"),
    ("parameters", "Parameters"),
    ("hidden", "What could hide"),
    ("guidance", "What next"),
    ("diagnostics", "Diagnostics"),
    ("assumptions", "Assumptions"),
    ("methods", "Methods"),
    ("reproduce", "Reproduce"),
)


def render(
    result: Result,
    pictures: Mapping[str, Drawn],
    sections: Sequence[str],
    origin: Mapping[str, Any] | None,
) -> str:
    """The page of an analysis (or of what closing the loop returns) with its figures.

    `sections` are ready as HTML: stable walls, and what to do next; `origin` is the `provenance` of
    `summary.json`.
    """
    analysis, closed = result.analysis, result.closed
    head = headline(result)
    page = template("report.jinja").render(
        **frame(),
        title=title(analysis, (origin or {}).get("file")),
        contents=(),
        result=result,
        analysis=analysis,
        closed=closed,
        measured=result.measured,
        headline=head,
        label=LABELS[head.status],
        lights=lights(result),
        answer=answer,
        next_steps=next_steps(head, result, origin),
        doubtful=words.doubtful(result),
        widened=words.widened(result),
        no_limit=unstated(analysis),
        untrusted=doubtful_parameters(result),
        notices=unique(analysis.notices),
        pictures={name: embedded(name, one, _SHOWN[name]) for name, one in pictures.items()},
        words=words,
        tables=tables,
        loop_words=loop_words,
        change_words=change_words,
        force_words=force_words,
        motion_words=motion_words(analysis),
        loop_tables=loop_tables,
        assumptions=assumptions(analysis, closed),
        priors=priors(analysis),
        methods=methods.methods(result),
        bibtex=methods.bibtex(result),
        reproduce=reproduce(result, origin),
        asked=asked(origin),
        files=[one for one in FILES if analysis.sampled or one[0] != "posterior.nc"],
        sections=sections,
    )
    return finished(page, _CONTENTS)


def title(analysis: Analysis, file: str | None = None) -> str:
    """What the report is about: the device, who held it, and the recording's or the file's name."""
    recording = analysis.recording
    device = None if analysis.device is None else analysis.device.name
    if recording is None:
        table = recording_name(Path(file)) if file else "a frequency response"
        return f"{device}: {table}" if device else table
    name = recording.device or device
    if name is None:
        return recording.name
    held = f", held by {recording.user}" if recording.user else ""
    return f"{name}{held}: {recording.name}"
