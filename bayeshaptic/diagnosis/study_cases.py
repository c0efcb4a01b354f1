"""From the recordings of a study to its cases: users, a new person, configurations, and nobody."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from bayeshaptic.errors import Notice
from bayeshaptic.inference.configurations import Configurations
from bayeshaptic.inference.population import Population
from bayeshaptic.stability.cases import Case, DeviceLimit, device_limit

Progress = Callable[[float, str], None]


@dataclass(frozen=True)
class StudyCases:
    """What the recordings of a study say together; attributes as in `StudyAnalysis`."""

    population: Population | None
    new_person: tuple[Case, ...]
    users: tuple[Case, ...]
    configurations: tuple[Configurations, ...]
    cases: tuple[Case, ...]
    limit: DeviceLimit | None
    notices: tuple[Notice, ...]
    seconds: Mapping[str, float]


def study_cases(recordings: Sequence[Any], seed: int, report: Progress) -> StudyCases:
    """Population, configurations, cases and limit from the analysed recordings of a study."""
    cases = []
    for one in recordings:
        analysis = one.analysis
        if analysis is None:
            continue
        held = one.entry.user is not None
        label = f"user {one.entry.user}" if held else "nobody holds it"
        cases.append(
            Case(
                label,
                "held" if held else "free",
                analysis.model,
                analysis.posterior.draws,
                analysis.limit,
            )
        )
    limit = device_limit(cases, seed) if cases else None
    return StudyCases(None, (), (), (), tuple(cases), limit, (), {})
