"""A stand-in for the analysis of a study: invented recordings, people and configurations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from fake_analysis import fake_analysis

from bayeshaptic.devices import load_device
from bayeshaptic.errors import Notice
from bayeshaptic.models import Model
from bayeshaptic.models.structures import HAND
from bayeshaptic.recordings.known_limits import KnownLimit
from bayeshaptic.recordings.study import Study, StudyEntry
from bayeshaptic.stability.cases import CONFIGURATION, FREE, HELD, NEW_PERSON, Case, device_limit
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.study.analysed import Analysed
from bayeshaptic.study.analysis import StudyAnalysis
from bayeshaptic.study.configuration_limits import ConfigurationLimits

DRAWS = 1500
NAMES = ("anna", "ben", "carla", "david", "emma", "farid", "gül <b>", "h")
SIX_DB = (40.60, 40.86, 41.35, 38.93, 42.64, 37.96)


def fake_study(
    people: int = 4,
    free: int = 1,
    places: tuple[float, ...] = (),
    device: str = "phantom",
    spread: float = 0.3,
    failed: int = 0,
    references: bool = False,
    notices: tuple[Notice, ...] = (),
    converged: bool = True,
    seed: int = 0,
) -> Any:
    """An analysed study of an invented device.

    Parameters
    ----------
    people, free, failed : int
        Recordings in a hand, without one, and such that could not be used.
    places : tuple of float
        Coordinates of configurations.
    spread : float
        Of the logarithms of the hand's parameters over people.
    """
    rng = np.random.default_rng(seed)
    recordings, cases, users = [], [], []
    for number in range(free):
        place = places[number % len(places)] if places else None
        one = fake_analysis("free", device, spread=0.01, seed=seed + number, converged=converged)
        entry = StudyEntry(Path(f"free-{number}.csv"), configuration=place)
        recordings.append(Analysed(f"free-{number}", entry, one))
        where = "" if place is None else f", configuration {place:g}"
        case = _case(f"nobody holds it{where}", FREE, one.model, one.posterior.draws)
        cases.append(replace(case, configuration=place))
    for number in range(people):
        one = fake_analysis("grasped", device, spread=0.01, seed=seed + 50 + number)
        own = _hand(one.model, one.posterior.draws, spread, rng)
        one.limit = critical_stiffness(one.model, own)
        place = places[0] if places else None
        entry = StudyEntry(Path(f"{number}.csv"), NAMES[number], configuration=place)
        recordings.append(Analysed(NAMES[number], entry, one))
        case = _case(f"user {NAMES[number]}", HELD, one.model, own[: DRAWS // 2])
        users.append(replace(case, user=NAMES[number], configuration=place))
    for number in range(failed):
        entry = StudyEntry(Path(f"bad-{number}.csv"), NAMES[-1])
        recordings.append(Analysed(f"bad-{number}", entry, None, "bad.csv: row 3 is 'oops'"))
    population, new, bands = None, (), ()
    if people:
        model = users[0].model
        population = _population(model, people, spread, rng)
        typical = np.tile(users[0].draws[0], (DRAWS, 1))
        case = _case("a person not yet seen", NEW_PERSON, model, _each(model, typical, spread, rng))
        new = (replace(case, configuration=places[0] if places else None),)
    if len(places) > 1:
        bands = tuple(_configurations(held, places, device) for held in (False, True))
        cases += [case for band in bands for case in band.cases]
    everything = (*cases, *users, *new)
    return StudyAnalysis(
        _study(device, recordings, references),
        load_device(device),
        tuple(recordings),
        population,
        new,
        tuple(users),
        bands,
        everything,
        device_limit(everything) if everything else None,
        notices,
        {"recordings": 12.0, "population": 3.0},
    )


def _case(label: str, group: str, model: Model, draws: Any) -> Case:
    draws = draws[:DRAWS]
    return Case(label, group, model, draws, critical_stiffness(model, draws))


def _hand(model: Model, draws: Any, spread: float, rng: Any) -> Any:
    """The draws with one other hand in all of them."""
    factors = np.ones(model.size)
    is_hand = np.isin(model.names, HAND)
    factors[is_hand] = np.exp(spread * rng.standard_normal(is_hand.sum()))
    return draws * factors


def _each(model: Model, draws: Any, spread: float, rng: Any) -> Any:
    """The draws with another hand in each of them."""
    is_hand = np.isin(model.names, HAND)
    return draws * np.exp(spread * rng.standard_normal(draws.shape) * is_hand)


def _population(model: Model, people: int, spread: float, rng: Any) -> Any:
    names = tuple(name for name in model.names if name in HAND)
    middle = np.log([model.reference[name] for name in names])
    size = (400, len(names))
    mixed = rng.standard_normal((400, len(names), len(names) + 4))
    covariance = mixed @ mixed.transpose(0, 2, 1)
    sd = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return SimpleNamespace(
        parameters=names,
        log_mean=middle + spread / np.sqrt(people) * rng.standard_normal(size),
        log_sd=spread * np.exp(0.3 * rng.standard_normal(size)),
        correlation=covariance / sd[:, :, None] / sd[:, None, :],
        users=NAMES[:people],
        places=(None,),
        model=model,
        notices=(),
        chains=None,
    )


def _configurations(held: bool, places: tuple[float, ...], device: str) -> ConfigurationLimits:
    one = fake_analysis("grasped" if held else "free", device, spread=0.02)
    coordinates = np.linspace(min(places), max(places), 3)
    index = one.model.names.index("b1")
    who = "held" if held else "nobody holds it"
    cases = []
    for coordinate in coordinates:
        there = one.posterior.draws[:DRAWS].copy()
        there[:, index] *= 1.2 - 0.4 * coordinate
        cases.append(_case(f"configuration {coordinate:g}, {who}", CONFIGURATION, one.model, there))
    samples = np.stack([case.limit.samples for case in cases], axis=1)
    measured, unit = np.array(places), one.limit.unit
    nothing: Any = None
    return ConfigurationLimits(held, coordinates, measured, samples, unit, tuple(cases), nothing)


def _study(device: str, recordings: list[Analysed], references: bool) -> Study:
    known = KnownLimit("Díaz and Gil (2010), Table IV", True, tuple(10 ** (d / 20) for d in SIX_DB))
    return Study(
        "study",
        Path("study.toml"),
        load_device(device),
        tuple(one.entry for one in recordings),
        references=(known,) if references else (),
    )
