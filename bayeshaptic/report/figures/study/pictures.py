"""The figures of a study's report, one module each with ``draw(study) -> Figure``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.report.figures.study import (
    configurations as study_configurations,
    limit as study_limit,
    people as study_people,
)
from bayeshaptic.report.figures.style import Drawn, drawn

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bayeshaptic.study.analysis import StudyAnalysis


@dataclass(frozen=True)
class StudyPicture:
    """A figure of a study: the name of its file, how to draw it, what it shows, and when."""

    name: str
    draw: Callable[[StudyAnalysis], Figure]
    alternative: str
    shown: Callable[[StudyAnalysis], bool]


STUDY_PICTURES = (
    StudyPicture(
        "study_limit",
        study_limit.draw,
        "Critical stiffness of every case, and the lowest of all",
        lambda study: study.limit is not None,
    ),
    StudyPicture(
        "study_people",
        study_people.draw,
        "Critical stiffness of a person not yet seen and of every person recorded",
        lambda study: bool(study.users),
    ),
    StudyPicture(
        "study_configurations",
        study_configurations.draw,
        "Critical stiffness over the configuration",
        lambda study: bool(study.configurations),
    ),
)


def draw_study_pictures(study: StudyAnalysis) -> dict[str, Drawn]:
    """Every figure of a study, by name."""
    return {p.name: drawn(p.draw(study), p.name) for p in STUDY_PICTURES if p.shown(study)}
