"""The figures of a study's report, one module each with ``draw(study) -> Figure``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.report.figures.pictures import Picture, all_drawn
from bayeshaptic.report.figures.study import (
    configurations as study_configurations,
    limit as study_limit,
    people as study_people,
)

if TYPE_CHECKING:
    from bayeshaptic.report.figures.style import Drawn
    from bayeshaptic.study.analysis import StudyAnalysis

STUDY_PICTURES = (
    Picture(
        "study_limit",
        study_limit.draw,
        "Critical stiffness of every case, and the lowest of all",
        lambda study: study.limit is not None,
    ),
    Picture(
        "study_people",
        study_people.draw,
        "Critical stiffness of a person not yet seen and of every person recorded",
        lambda study: bool(study.users),
    ),
    Picture(
        "study_configurations",
        study_configurations.draw,
        "Critical stiffness over the configuration",
        lambda study: bool(study.configurations),
    ),
)


def draw_study_pictures(study: StudyAnalysis) -> dict[str, Drawn]:
    """Every figure of a study, by name."""
    return all_drawn(STUDY_PICTURES, study)
