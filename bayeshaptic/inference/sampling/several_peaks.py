"""A proposal for a density of several peaks, each with a proposal of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.inference.sampling.proposal import Proposal, generator_of
from bayeshaptic.numerics.straightening import Straightening, nothing_to_straighten
from bayeshaptic.types import Floats, LogDensity

_LEAST = 0.1  # share of proposals that go to all peaks alike


@dataclass(frozen=True)
class SeveralPeaks:
    """What walkers propose where the density has several peaks, in sampling coordinates.

    Attributes
    ----------
    peaks : tuple of Proposal
        Each in straight coordinates of its own: ridges of other peaks bend in another way.
    weights : ndarray, shape (K,)
        Of independent proposals.
    """

    peaks: tuple[Proposal, ...]
    weights: Floats = field(repr=False)

    @classmethod
    def of(cls, peaks: tuple[Proposal, ...], held: Floats) -> SeveralPeaks:
        """With weights by how much of the density each has `held`, logarithms of shape (K,)."""
        return cls(peaks, (1 - _LEAST) * shares_of(held) + _LEAST / len(peaks))

    @property
    def straightening(self) -> Straightening:
        """None that they share."""
        return nothing_to_straighten(self.peaks[0].archive.shape[1])

    @cached_property
    def _log_volumes(self) -> Floats:
        """Of a unit of sampling coordinates in each peak's own, logarithm, shape (K,)."""
        return np.array([np.linalg.slogdet(one.straightening.whiten)[1] for one in self.peaks])

    def log_density(self, walkers: Floats) -> Floats:
        """Of independent proposals, at points of shape (B, P)."""
        parts = [one.mixture.log_density(one.straightening.straight(walkers)) for one in self.peaks]
        logs = np.stack(parts) + (np.log(self.weights) + self._log_volumes)[:, None]
        return np.asarray(np.logaddexp.reduce(logs, axis=0))

    def independent(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A draw about one of the peaks for each walker."""
        generator = generator_of(rng)
        chosen = generator.choice(len(self.peaks), size=len(walkers), p=self.weights)
        drawn = np.empty_like(walkers)
        for index, one in enumerate(self.peaks):
            own = chosen == index
            y = one.mixture.sample(generator, int(own.sum()))
            drawn[own] = one.straightening.bent(y)
        here, there = np.split(self.log_density(np.concatenate([walkers, drawn])), 2)
        return drawn, here - there

    def differences(self, walkers: Floats, rng: np.random.RandomState) -> tuple[Floats, Floats]:
        """A step by the difference of two points about one peak for each walker."""
        chosen = generator_of(rng).choice(len(self.peaks), size=len(walkers), p=self.weights)
        moved = walkers.copy()
        for index, one in enumerate(self.peaks):
            own = chosen == index
            if own.any():
                y, _ = one.differences(one.straightening.straight(walkers[own]), rng)
                moved[own] = one.straightening.bent(y)
        return moved, np.zeros(len(walkers))

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """All of it, for a checkpoint."""
        parts = {
            f"{index} {name}": array
            for index, one in enumerate(self.peaks)
            for name, array in one.to_arrays().items()
        }
        return {"weights of peaks": self.weights, **parts}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> SeveralPeaks:
        """What `to_arrays` kept."""
        weights = arrays["weights of peaks"]
        peaks = []
        for index in range(len(weights)):
            start = f"{index} "
            own = {n.removeprefix(start): a for n, a in arrays.items() if n.startswith(start)}
            peaks.append(Proposal.from_arrays(own))
        return cls(tuple(peaks), weights)


def restored(arrays: Mapping[str, NDArray[Any]]) -> Proposal | SeveralPeaks:
    """The proposal that a checkpoint kept."""
    kind = SeveralPeaks if "weights of peaks" in arrays else Proposal
    return kind.from_arrays(arrays)


def shares_of(held: Floats) -> Floats:
    """Of logarithms, shape (K,), which may be of any size: what each is of the whole, one in all.

    Known standard deviations make log likelihoods of 1e9, where a logarithm is rounded to 1e-7.
    """
    parts = np.exp(held - np.max(held))
    return np.asarray(parts / parts.sum())


def log_held(density: LogDensity, proposal: Proposal) -> float:
    """Log of how much of the density lies where a proposal draws, by weighted draws."""
    y = proposal.mixture.sample(np.random.default_rng(0), 1000)
    volume = np.linalg.slogdet(proposal.straightening.whiten)[1]
    proposed = proposal.mixture.log_density(y) + volume
    return log_mean(log_weights(density(proposal.straightening.bent(y)), proposed))


def log_weights(density: Floats, proposed: Floats) -> Floats:
    """Of draws by their log densities, shape (B,); -inf where there is none of either."""
    with np.errstate(invalid="ignore"):
        weights = density - proposed
    return np.where(np.isfinite(weights), weights, -np.inf)


def log_mean(weights: Floats) -> float:
    """Log of the mean of weights of which the logarithms are given."""
    return float(np.logaddexp.reduce(weights)) - float(np.log(len(weights)))


def covered(proposal: Proposal, points: Floats) -> NDArray[np.bool_]:
    """Which points, shape (B, P), are among those that a proposal draws; shape (B,)."""
    drawn = proposal.mixture.log_density(proposal.archive)
    own = proposal.mixture.log_density(proposal.straightening.straight(points))
    rare = 0.01
    return np.asarray(own > np.quantile(drawn, rare))
