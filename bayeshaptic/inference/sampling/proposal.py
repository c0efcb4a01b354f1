"""What walkers propose: a mixture fitted to where they have been, and how well it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.sampling.near_zero import Redraw
from bayeshaptic.numerics.mixture import StudentMixture, student
from bayeshaptic.numerics.mixture_fit import fit_student_mixture
from bayeshaptic.numerics.straightening import Straightening, nothing_to_straighten, straighten
from bayeshaptic.types import Floats, LogDensity

# Log of density over proposal, above the median, from which a place is missed.
_MISSED = 1.5
# Degrees of freedom of what a proposal is made of, next to normal as posteriors are, and of what
# covers its tails.  In eleven dimensions five throughout cost a third of what is accepted.
_FREEDOM, _SAFE = 30.0, 5.0
_ARCHIVE = 4000  # places between which differences are taken


@dataclass(frozen=True)
class Proposal:
    """What walkers propose, in straight coordinates; walkers share it, and nothing else.

    Attributes
    ----------
    straightening : Straightening
    mixture : StudentMixture
        Of independent proposals.
    archive : ndarray, shape (n, P)
        Points whose differences are steps.
    """

    straightening: Straightening
    mixture: StudentMixture
    archive: Floats = field(repr=False)

    @classmethod
    def first(cls, mixture: StudentMixture, rng: np.random.Generator) -> Proposal:
        """One that nothing is known about yet but a mixture."""
        straight = nothing_to_straighten(mixture.means.shape[1])
        return cls(straight, mixture, mixture.sample(rng, _ARCHIVE))

    def independent(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A draw from the mixture for each walker."""
        drawn = self.mixture.sample(generator_of(rng), len(walkers))
        here, there = np.split(self.mixture.log_density(np.concatenate([walkers, drawn])), 2)
        return drawn, here - there

    def differences(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A step by the difference of two points of the archive for each walker.

        Differential evolution from the past (C. J. F. ter Braak and J. A. Vrugt, Statistics and
        Computing 18, 2008), with an archive that does not change: all walkers move at once, and
        each is a chain of its own.
        """
        generator, (count, size) = generator_of(rng), walkers.shape
        ends = self.archive[generator.integers(len(self.archive), size=(2, count))]
        leaps = 0.1  # of the differences that are taken whole: from one hump to another
        length = np.where(generator.uniform(size=count) < leaps, 1.0, 2.38 / np.sqrt(2 * size))
        step = length[:, None] * (ends[0] - ends[1])
        jitter = 1e-5
        step += jitter * generator.standard_normal(walkers.shape)
        return walkers + step, np.zeros(count)

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it, for a checkpoint."""
        parts = (self.straightening, self.mixture)
        kept = {f.name: getattr(part, f.name) for part in parts for f in fields(part)}
        return {**kept, "archive": self.archive}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Proposal:
        """What `to_arrays` kept."""
        straightening = Straightening(**{f.name: arrays[f.name] for f in fields(Straightening)})
        mixture = StudentMixture(**{f.name: arrays[f.name] for f in fields(StudentMixture)})
        return cls(straightening, mixture, arrays["archive"])


def fitted(
    chains: Floats,
    log_density: Floats,
    density: LogDensity,
    redraw: Redraw | None,
    rng: np.random.Generator,
) -> Proposal:
    """A proposal for a density, from draws and the log densities there.

    Places where it misses the density get a share of their own.  Walkers that have been there show
    them, where they stay for long, and so does a `redraw` of what may be next to zero: tails that
    reach over many scales hold a hundredth of the draws, and walkers that do not know them yet
    would hang there later.

    Parameters
    ----------
    chains : ndarray, shape (ensembles, steps, walkers, P)
    log_density : ndarray, shape (ensembles, steps, walkers)
    density : callable
    redraw : callable, optional
    rng : Generator
    """
    found = chains.swapaxes(1, 2).reshape(-1, chains.shape[-1])  # a walker after the other
    values = log_density.swapaxes(1, 2).ravel()
    straightening = straighten(found, chains.shape[1])
    y = straightening.straight(found)
    _, once = np.unique(values, return_index=True)  # a walker that stays is found many times
    size = y.shape[1]
    numbers = 1 + size + size * (size + 1) // 2  # of a component
    points_a_number = 20  # fewer, and components follow the accidents of the draws
    most_components = 6
    components = int(np.clip(len(once) / (points_a_number * numbers), 1, most_components))
    mixture = fit_student_mixture(y, np.ones(len(y)), components, _FREEDOM, rng)
    wide = student(y.mean(axis=0), 1.5 * np.cov(y.T), _SAFE)
    mixture = mixture.with_component(wide, 0.1)
    places, there = found[once], values[once]
    if redraw is not None:
        tried = 1000
        drawn, _ = redraw(found[rng.choice(len(found), tried)], rng)
        places, there = np.concatenate([places, drawn]), np.append(there, density(drawn))
    at = straightening.straight(places)
    tails = 3
    for _ in range(tails):
        excess = there - mixture.log_density(at)
        missed = at[excess > np.median(excess[: len(once)]) + _MISSED]
        if len(missed) <= 4 * size:
            break
        around = student(missed.mean(axis=0), 1.2 * np.cov(missed.T), _SAFE)
        mixture = mixture.with_component(around, 0.08)
    return Proposal(straightening, mixture, y[rng.choice(len(y), _ARCHIVE)])


def acceptance(
    density: LogDensity,
    proposal: Proposal,
    found: Floats,
    values: Floats,
    rng: np.random.Generator,
) -> float:
    """How often proposals are accepted, by walkers at `found` and between draws of the proposal.

    The walkers (W, P), whose log densities are `values` (W,), tell where the proposal misses the
    density; its own draws, weighted, whether walkers have spread over humps as the density does.
    """
    tried = 1000
    here = rng.choice(len(found), tried)
    drawn = proposal.mixture.sample(rng, tried)
    there = density(proposal.straightening.bent(drawn)) - proposal.mixture.log_density(drawn)
    straight = proposal.straightening.straight(found[here])
    gain = there - (values[here] - proposal.mixture.log_density(straight))
    weights = np.sort(np.exp(there - np.max(there, initial=-np.finfo(float).max)))[::-1]
    lesser = weights @ (2 * np.arange(tried) + 1) / tried  # of all pairs, the lesser weight
    between = lesser / max(weights.sum(), np.finfo(float).tiny)
    return min(float(np.mean(np.exp(np.minimum(gain, 0.0)))), float(between))


def generator_of(rng: np.random.RandomState) -> np.random.Generator:
    """A generator for a move, by what emcee hands over."""
    return np.random.default_rng(rng.randint(2**31))
