"""The page of a study: one device, all its recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from bayeshaptic.errors import unique
from bayeshaptic.provenance import versions
from bayeshaptic.report.figures.study.pictures import STUDY_PICTURES
from bayeshaptic.report.page.frame import LABELS, embedded, finished, frame, template
from bayeshaptic.report.study import tables as study_tables
from bayeshaptic.report.study.assumptions import assumptions
from bayeshaptic.report.study.headline import study_headline
from bayeshaptic.report.study.words import configurations, hands, hidden, missing, people
from bayeshaptic.report.tables import crossings

if TYPE_CHECKING:
    from bayeshaptic.report.figures.style import Drawn
    from bayeshaptic.study.analysis import StudyAnalysis


_CONTENTS = (
    ("summary", "Summary"),
    ("limit", "Limit"),
    ("people", "People"),
    ("configurations", "Configurations"),
    ("hidden", "What could hide"),
    ("recordings", "Recordings"),
    ("walls", "Walls"),
    ("guidance", "What next"),
    ("notices", "Warnings"),
    ("missing", "What is missing"),
    ("assumptions", "Assumptions"),
    ("provenance", "Provenance"),
)


def render_study(
    study: StudyAnalysis,
    pictures: Mapping[str, Drawn],
    pages: Mapping[str, str],
    parts: Sequence[str],
) -> str:
    """The page.

    Parameters
    ----------
    study : StudyAnalysis
    pictures : mapping of str to Drawn
    pages : mapping of str to str
        Where each recording's own report is, relative to this page.
    parts : sequence of str
        Further sections, as HTML.
    """
    head = study_headline(study)
    words = {picture.name: picture.alternative for picture in STUDY_PICTURES}
    page = template("study.jinja").render(
        **frame(),
        study=study,
        headline=head,
        label=LABELS[head.status],
        notices=unique(tuple(n for n in study.notices if n.topic != "recordings")),
        failed=study.failed,
        tables=study_tables,
        pages=dict(pages),
        trials=any(
            o.entry.trial is not None or o.entry.level is not None for o in study.recordings
        ),
        hands=hands(study),
        people=people(study),
        people_caption=_people_caption(study),
        correlations=study_tables.correlations(study.population) if study.population else (),
        crossings=crossings(study.new_person[0].limit) if study.new_person else (),
        configurations=configurations(study),
        hidden=hidden(study),
        parts=tuple(parts),
        lacking=missing(study),
        pictures={name: embedded(name, one, words[name]) for name, one in pictures.items()},
        assumptions=assumptions(study),
        versions=tuple(versions().items()),
    )
    return finished(page, _CONTENTS)


def _people_caption(study: StudyAnalysis) -> str:
    text = (
        "Above: the critical stiffness for a person who was not recorded, one colour and hatching "
        "for each crossing that may limit it."
    )
    if any(reference.held for reference in study.study.references):
        text += " Triangles: limits known from elsewhere, which took no part in the analysis."
    return (
        f"{text} Below: everybody of the population, by their own recording alone and together "
        "with what all people say; bars are 90 % intervals."
    )
