"""What the cases of a study are: held or free, with enough draws, from which recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.stability.cases import CONFIGURATION, FREE, HELD

if TYPE_CHECKING:
    from bayeshaptic.stability.cases import Case
    from bayeshaptic.study.analysed import Analysed
    from bayeshaptic.study.analysis import StudyAnalysis


def is_free(label: str, group: str) -> bool:
    """Whether nobody holds the device in a case, recorded or predicted along a coordinate."""
    return group == FREE or (group == CONFIGURATION and label.endswith("nobody holds it"))


def held_cases(study: StudyAnalysis) -> tuple[Case, ...]:
    """Of everybody who was recorded: those in the population, then those who are not."""
    apart = [case for case in study.cases if case.group == HELD and case not in study.users]
    return (*study.users, *apart)


def has_draws(case: Case) -> bool:
    """Whether a case has enough different draws for an interval, and not a few weighted ones."""
    fewest = 20  # different draws, for an interval
    return len(np.unique(case.limit.samples)) >= fewest


def raw_limits(study: StudyAnalysis) -> dict[str, tuple[Any, ...]]:
    """Limits of each user's recordings by themselves, by the label of the user's case."""
    found: dict[str, tuple[Any, ...]] = {}
    for case in study.users:
        found[case.label] = tuple(
            one.analysis.limit
            for one in study.recordings
            if one.analysis is not None and one.entry.user is not None and belongs(one, case)
        )
    return found


def belongs(one: Analysed, case: Case) -> bool:
    """Whether a recording is of the user, and the configuration, of a case."""
    entry = one.entry
    return (entry.user, entry.configuration) == (case.user, case.configuration)
