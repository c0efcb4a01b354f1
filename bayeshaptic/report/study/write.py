"""Writing the report of a study: one page for the device, everything or nothing."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from bayeshaptic.arguments import at_the_door
from bayeshaptic.files import resolved, write_text
from bayeshaptic.report.draft import report_in
from bayeshaptic.report.figures.drawing.look import own_look
from bayeshaptic.report.figures.study.pictures import STUDY_PICTURES, draw_study_pictures
from bayeshaptic.report.guidance.section import FIGURES as ADVICE, guidance_section
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.study.page import render_study
from bayeshaptic.report.study.population_json import population_json
from bayeshaptic.report.walls.section import FIGURES as WALLS, limits_section, table_of

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.report.page.section import Section
    from bayeshaptic.stability.cases import Case
    from bayeshaptic.study.analysis import StudyAnalysis

# Whoever waits for a report looks for its numbers: they arrive when the rest is there.
_LAST = "population.json"
_MAY_BE_MISSING = (
    "limits.json",
    "limits.csv",
    "index.html",
    *(f"{name}.png" for name in (*(p.name for p in STUDY_PICTURES), *WALLS, *ADVICE)),
)
NAMES = (_LAST, "report.html", *_MAY_BE_MISSING)
"""Of all files that the page of a study may have."""


@at_the_door
def write_study_report(
    study: StudyAnalysis,
    out_dir: str | Path,
    pages: Mapping[str, str | Path] | None = None,
    walls: bool = True,
) -> Path:
    """Write report.html, population.json, limits.json, limits.csv and the figures of a study.

    The files are made in a hidden folder and moved when all of them are there: an interrupted run
    leaves what was there before. Other files in `out_dir` stay.

    Parameters
    ----------
    study : StudyAnalysis
    out_dir : str or Path
        Made where it is missing, with its parents.
    pages : mapping of str to path, optional
        Where each recording's own report is, by the recording's name; linked relative to `out_dir`.
    walls : bool
        Whether to go into stable walls (stiffness and damping) and what would raise the limit.

    Returns
    -------
    Path
        Of report.html.

    Raises
    ------
    InputError
        If `out_dir` is a file, or holds a recording, or what is of no report, under the name of one
        of these files.
    """
    out = resolved(out_dir)
    links = {name: _link(Path(page), out) for name, page in (pages or {}).items()}
    with report_in(out_dir, _LAST, _MAY_BE_MISSING, study.study.files) as folder, own_look():
        _write_all(study, folder, links, walls)
    return out / "report.html"


def _write_all(study: StudyAnalysis, folder: Path, links: Mapping[str, str], walls: bool) -> None:
    pictures = draw_study_pictures(study)
    sections = _sections(study, folder) if walls else []
    for shown in (pictures, *(part.pictures for part in sections)):
        for name, drawn in shown.items():
            (folder / f"{name}.png").write_bytes(drawn.png)
    page = render_study(study, pictures, links, [part.html for part in sections])
    write_text(folder / "report.html", page)
    write_text(folder / _LAST, population_json(study))


def _sections(study: StudyAnalysis, folder: Path) -> list[Section]:
    """Stable walls over all cases, with their files; and what would raise the limit."""
    if study.limit is None:
        return []
    head = study_headline(study)
    table = table_of(study.cases, limit=study.limit)
    table.write(folder, study.device.name, head.status, head.stiffness)
    if head.status == "untrusted":  # walls and designs of a limit that nobody is to use
        return []
    walls = limits_section(table, resolution=study.device.encoder_resolution)
    first = study.limit.binding[0].case
    case = next(case for case in study.cases if case.label == first)
    alone = len(study.cases) == 1
    advice = guidance_section(case, _analysis_of(case, study), "" if alone else case.label)
    return [walls] if advice is None else [walls, advice]


def _analysis_of(case: Case, study: StudyAnalysis) -> Analysis | None:
    """The recording that a case is, where it is one alone."""
    return next(
        (
            one.analysis
            for one in study.recordings
            if one.analysis and one.analysis.limit is case.limit
        ),
        None,
    )


def _link(page: Path, out: Path) -> str:
    return Path(os.path.relpath(resolved(page), out)).as_posix()
