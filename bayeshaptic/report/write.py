"""Writing a report: everything or nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from bayeshaptic.arguments import at_the_door
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.files import resolved, write_text
from bayeshaptic.report.draft import report_in
from bayeshaptic.report.figures.drawing.look import own_look
from bayeshaptic.report.figures.pictures import (
    FORCE_PICTURES,
    LOOP_PICTURES,
    PICTURES,
    draw_pictures,
)
from bayeshaptic.report.guidance.section import FIGURES as ADVICE, guidance_section
from bayeshaptic.report.headline import headline
from bayeshaptic.report.hidden.section import hidden_section
from bayeshaptic.report.html import render
from bayeshaptic.report.numbers.unstated import unstated
from bayeshaptic.report.page.section import Section
from bayeshaptic.report.summary import summary_json
from bayeshaptic.report.walls.section import (
    FIGURES as WALLS,
    case_of,
    friction_of,
    limits_section,
    resolution_of,
    table_of,
)
from bayeshaptic.threads import single_threaded

# Whoever waits for a report looks for its summary: it arrives when the rest is there.
_LAST = "summary.json"
_PICTURES = tuple(p.name for p in (*PICTURES, *LOOP_PICTURES, *FORCE_PICTURES))
_MAY_BE_MISSING = (
    "posterior.nc",
    *(f"{name}.png" for name in (*_PICTURES, *WALLS, *ADVICE, "hidden")),
)
NAMES = (_LAST, "report.html", "limits.json", "limits.csv", *_MAY_BE_MISSING)
"""Of all files that a report may have."""


@at_the_door
@single_threaded
def write_report(
    result: Result, out_dir: str | Path, origin: Mapping[str, Any] | None = None
) -> Path:
    """Write report.html, summary.json, limits.json and .csv, posterior.nc and the figures.

    The files are made in a hidden folder and moved when all of them are there: an interrupted run
    leaves what was there before. Other files in `out_dir` stay.

    Parameters
    ----------
    result : Analysis, or what closing the loop returns
    out_dir : str or Path
        Made where it is missing, with its parents.
    origin : mapping or None
        The `provenance` of `summary.json`, where the caller knows more than the result.

    Returns
    -------
    Path
        Of report.html.

    Raises
    ------
    InputError
        If `out_dir` is a file, or holds the recording, or what is of no report, under the name of
        one of these files.
    """
    recording = result.analysis.recording
    of = (None if recording is None else recording.source, (origin or {}).get("file"))
    sources = [path for path in of if path is not None]
    with report_in(out_dir, _LAST, _MAY_BE_MISSING, sources) as folder, own_look():
        _write_all(result, folder, origin)
    return resolved(out_dir) / "report.html"


def _write_all(result: Result, folder: Path, origin: Mapping[str, Any] | None) -> None:
    analysis = result.analysis
    pictures = draw_pictures(result)
    sections = _sections(result, folder)
    for part in (pictures, *(section.pictures for section in sections)):
        for name, drawn in part.items():
            (folder / f"{name}.png").write_bytes(drawn.png)
    if analysis.sampled:
        analysis.stated.save(folder / "posterior.nc")
    page = render(result, pictures, [section.html for section in sections], origin)
    write_text(folder / "report.html", page)
    write_text(folder / _LAST, summary_json(result, origin))


def _sections(result: Result, folder: Path) -> tuple[Section, ...]:
    """The sections about stable walls, with their table in `folder`."""
    analysis = result.analysis
    head = headline(result)
    case = case_of(result)
    table = table_of([case])
    name = None if analysis.device is None else analysis.device.name
    replace(table, reason=unstated(analysis)).write(folder, name, head.status, head.stiffness)
    if head.status == "untrusted":  # walls and designs of a limit that nobody is to use
        return ()
    walls = limits_section(table, friction_of(result), resolution_of(analysis))
    others = hidden_section(analysis), guidance_section(case, analysis)
    return (walls, *(one for one in others if one is not None))
