"""From the recordings of a study to its cases: users, a new person, configurations, and nobody."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.errors import Notice, describe
from bayeshaptic.inference.population.configurations import FEWEST
from bayeshaptic.inference.population.infer import infer_population
from bayeshaptic.inference.population.population import Population
from bayeshaptic.quantities import quantity
from bayeshaptic.stability.cases import FREE, HELD, NEW_PERSON, Case, DeviceLimit, device_limit
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.study.analysed import Analysed
from bayeshaptic.study.configuration_limits import ConfigurationLimits, configuration_limits
from bayeshaptic.study.recorded_cases import (
    contradictions,
    period_s,
    place_of,
    posterior,
    recorded,
    signature,
    widening,
)
from bayeshaptic.types import Progress


@dataclass(frozen=True)
class StudyCases:
    """What the recordings of a study say together; attributes as in `StudyAnalysis`."""

    population: Population | None
    new_person: tuple[Case, ...]
    users: tuple[Case, ...]
    configurations: tuple[ConfigurationLimits, ...]
    cases: tuple[Case, ...]
    limit: DeviceLimit | None
    notices: tuple[Notice, ...]
    seconds: Mapping[str, float]


@dataclass
class _Notes:
    """What is to be said, and how long each stage took."""

    notices: list[Notice] = field(default_factory=list)
    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str, of: str = "") -> Iterator[None]:
        """A stage that may fail without stopping the study; `name` is the word that explains it."""
        began = time.perf_counter()
        try:
            yield
        except Exception as error:
            self.notices.append(Notice("warning", name, f"No {name}{of}: {describe(error)}"))
        self.seconds[name + of] = time.perf_counter() - began


def study_cases(recordings: Sequence[Analysed], seed: int, report: Progress) -> StudyCases:
    """Population, configurations, cases and limit from the analysed recordings of a study.

    Parameters
    ----------
    recordings : sequence of Analysed
        Those that failed are left aside.
    seed : int
    report : callable
        Called with the share done and a word about it.
    """
    good = [one for one in recordings if one.analysis is not None]
    held = [one for one in good if one.entry.user is not None]
    free = [one for one in good if one.entry.user is None]
    notes = _Notes()
    like, odd = _alike(held)
    notes.notices += [*_two_names(good), *_periods(good), *contradictions(free)]
    notes.notices += _odd_notice(odd, like)
    population, new_person, users = _people(like, seed, report, notes)
    ways: list[ConfigurationLimits] = []
    covered: list[Analysed] = []
    for is_held, some, begin in ((False, free, 0.6), (True, like, 0.8)):
        measured = _alike([one for one in some if _numbered(one)])[0]
        with notes.stage("configurations", " (held)" if is_held else " (free)"):
            way = _along(measured, is_held, seed, report, begin)
            if way is not None:
                ways.append(way)
                covered += measured
                notes.notices += way.inferred.notices
    along = [case for way in ways for case in way.cases]
    cases = (
        *recorded([one for one in free if one not in covered], FREE, along),
        *users,
        *recorded([one for one in held if not users or one in odd], HELD, [*users, *along]),
        *new_person,
        *along,
    )
    return StudyCases(
        population,
        new_person,
        users,
        tuple(ways),
        cases,
        device_limit(cases, seed) if cases else None,
        tuple(notes.notices),
        notes.seconds,
    )


def _people(
    like: Sequence[Analysed], seed: int, report: Progress, notes: _Notes
) -> tuple[Population | None, tuple[Case, ...], tuple[Case, ...]]:
    """The population of those recorded alike, a new person's cases, and the users' cases."""
    if like:
        with notes.stage("population"):
            found = infer_population(
                [posterior(one) for one in like],
                [str(one.entry.user) for one in like],
                [one.entry.configuration for one in like],
                seed,
                lambda share, word: report(0.5 * share, word),
            )
            notes.notices += found.notices
            report(0.5, "critical stiffness of people")
            new_person = _new_person(found, like, seed)
            return found, new_person, _users(found, like, seed)
    return None, (), ()


def _numbered(one: Analysed) -> bool:
    """Is its configuration a coordinate?"""
    return isinstance(one.entry.configuration, int | float)


def _alike(some: Sequence[Analysed]) -> tuple[list[Analysed], list[Analysed]]:
    """The recordings with the most common model, effects and period, and the others."""
    counts = Counter(signature(one) for one in some)
    if not counts:
        return [], []
    common = counts.most_common(1)[0][0]
    like = [one for one in some if signature(one) == common]
    return like, [one for one in some if signature(one) != common]


def _odd_notice(odd: Sequence[Analysed], like: Sequence[Analysed]) -> list[Notice]:
    if not odd:
        return []
    several = bool(_periods([*like, *odd]))

    def told(one: Analysed) -> str:
        effects = ", ".join(one.effects) or "no effect"
        return f"{effects}, {quantity(period_s(one), 's')}" if several else effects

    common = told(like[0])
    others = "; ".join(f"{one.name} ({told(one)})" for one in odd)
    of = f"the {len(like)} recordings" if len(like) > 1 else "the one recording"
    same = f"the same model and {common}" if len(like) > 1 else common
    text = (
        f"The population is that of {of} with {same}. Left out, and cases of their own: {others}."
    )
    return [Notice("warning", "population", text)]


def _two_names(some: Sequence[Analysed]) -> list[Notice]:
    """That a user or a configuration has two names, which differ in capitals and spaces alone."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for one in some:
        for what, name in (("user", one.entry.user), ("configuration", one.entry.configuration)):
            if isinstance(name, str):
                found.setdefault((what, " ".join(name.casefold().split())), {})[name] = None
    return [
        Notice(
            "warning",
            "two names",
            f"The {what}s {' and '.join(map(repr, names))} differ in capitals or spaces "
            f"alone, and count as {len(names)}. If they are one, give all of its recordings one "
            "name.",
        )
        for (what, _), names in found.items()
        if len(names) > 1
    ]


def _periods(some: Sequence[Analysed]) -> list[Notice]:
    """That recordings have several periods; nothing where they have one."""
    found = sorted({f"{period_s(one):.3e}": period_s(one) for one in some}.values())
    if len(found) < 2:
        return []
    text = (
        f"The recordings have several periods: {', '.join(quantity(t, 's') for t in found)}. The "
        "limit of each is that of a loop with its own, and the device's is the lowest of them; "
        "study those with the period of the loop that is to render walls by themselves."
    )
    return [Notice("warning", "period", text)]


def _new_person(population: Population, like: Sequence[Analysed], seed: int) -> tuple[Case, ...]:
    """People not yet seen, in every configuration that people were measured in.

    That in which most of them were measured comes first: it stands for a new person's limit.
    """
    wider = widening(like)
    seen = Counter(one.entry.configuration for one in like)
    cases = []
    people = 25_000  # at least, that are drawn from all draws of the population
    for number in sorted(range(len(population.places)), key=lambda n: -seen[population.places[n]]):
        place = population.places[number]
        rng = np.random.default_rng(np.random.SeedSequence([seed, number, 1]))
        each = -(-people // len(population.log_mean))
        draws = population.new_person(rng, each, number)
        # People from one draw of the population, or from neighbours of one walker, are not
        # independent.
        limit = critical_stiffness(population.model, draws)
        limit = wider.apply(replace(limit, chains=population.walkers), rng)
        label = "a new person" + place_of(place)
        cases.append(Case(label, NEW_PERSON, population.model, draws, limit, configuration=place))
    return tuple(cases)


def _users(population: Population, like: Sequence[Analysed], seed: int) -> tuple[Case, ...]:
    """Every user's limit given all recordings, one case a configuration."""
    found: dict[tuple[str | None, float | str | None], list[int]] = {}
    for number, one in enumerate(like):
        found.setdefault((one.entry.user, one.entry.configuration), []).append(number)
    cases = []
    for (user, place), own in found.items():
        rng = np.random.default_rng(np.random.SeedSequence([seed, own[0], 2]))
        draws = np.concatenate([population.recordings[number].draws for number in own])
        wider = widening([like[number] for number in own])
        limit = wider.apply(critical_stiffness(population.model, draws), rng)
        label = f"user {user}" + place_of(place)
        cases.append(
            Case(label, HELD, population.model, draws, limit, user=user, configuration=place)
        )
    return tuple(cases)


def _along(
    some: Sequence[Analysed], held: bool, seed: int, report: Progress, begin: float
) -> ConfigurationLimits | None:
    """K_CR over a numeric coordinate; None where there are too few of them."""
    where = [float(one.entry.configuration or 0.0) for one in some]
    if len(set(where)) < FEWEST:
        return None
    found = configuration_limits(
        [posterior(one) for one in some],
        where,
        held,
        seed,
        lambda share, word: report(begin + 0.2 * share, word),
    )
    wider = widening(some)
    # The same random numbers for every configuration: they are drawn together.
    limits = [wider.apply(case.limit, np.random.default_rng(seed)) for case in found.cases]
    cases = tuple(replace(c, limit=one) for c, one in zip(found.cases, limits, strict=True))
    return replace(found, cases=cases, samples=np.stack([one.samples for one in limits], axis=1))
