"""The model average: nothing more, one more effect, or two, by their evidence.

Every effect has its prior probability by itself, so that two of them have the product of their
odds.  The evidence of two at once is that of each, times what they take away from each other to
first order; three are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.special import logsumexp

from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.hidden.regression import Around
from bayeshaptic.diagnosis.hidden.weighed import KEPT, PAIRED, Weighed
from bayeshaptic.numerics.weights import systematic
from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True)
class Told:
    """What other recordings say of an effect.

    Attributes
    ----------
    kept : ndarray, shape (KEPT,)
        Of the sizes of its draws.
    every : ndarray, shape (C,)
        Of the sizes that its evidence is of.
    """

    kept: Floats
    every: Floats


@dataclass(frozen=True)
class Looked:
    """Every effect that was looked at, and what two of them share.

    Attributes
    ----------
    weighed : tuple of Weighed
        E effects, at one place each.
    taken_up : ndarray, shape (E, D, F)
        What the parameters take up of the changes of each effect.
    gain : ndarray, shape (E, E)
        What the evidence of two has beyond the sum of theirs.
    """

    weighed: tuple[Weighed, ...]
    taken_up: Floats = field(repr=False)
    gain: Floats = field(repr=False)

    def meeting(self, one: int, other: int) -> Floats:
        """Log weight of each two draws of two effects, over that of either alone, (D, D)."""
        own, others = self.weighed[one].changes, self.weighed[other].changes
        return _meeting(own, others, self.taken_up[one], self.taken_up[other])

    def with_more(self, told: Mapping[int, Told], rng: np.random.Generator) -> Looked:
        """The same with what other recordings say of the sizes of some effects, by their number.

        Draws are drawn again by that evidence; those for which two effects share something stay
        among the old ones.
        """
        weighed, taken_up = list(self.weighed), self.taken_up.copy()
        for number, said in told.items():
            rows = _drawn_again(said.kept[::PAIRED], rng)
            kept = _drawn_again(said.kept, rng)
            kept[::PAIRED] = PAIRED * rows
            weighed[number] = self.weighed[number].with_more(said.every, kept)
            taken_up[number] = taken_up[number][rows]
        return Looked(tuple(weighed), taken_up, _gain(weighed, taken_up))


def _drawn_again(log_weight: Floats, rng: np.random.Generator) -> Ints:
    """Indices of as many draws, drawn anew by their weight, in random order."""
    weight = np.exp(log_weight - log_weight.max())
    return rng.permutation(systematic(weight, len(weight), rng))


def _meeting(one: Floats, other: Floats, taken_up: Floats, other_taken_up: Floats) -> Floats:
    """See `Looked.meeting`: of changes (A, N), (B, N) and what is taken up of them; (A, B)."""
    most_gain = 3.0  # log evidence that two effects may gain by cancelling each other
    return np.minimum(taken_up @ other_taken_up.T - one @ other.T, most_gain)


def _gain(weighed: Sequence[Weighed], taken_up: Floats) -> Floats:
    """The log of the mean weight of all draws of each two effects."""
    changes = np.concatenate([one.changes for one in weighed])
    count, draws, _ = taken_up.shape
    flat = taken_up.reshape(count * draws, -1)
    meeting = _meeting(changes, changes, flat, flat).reshape(count, draws, count, draws)
    return np.asarray(logsumexp(meeting, axis=(1, 3)) - np.log(draws * draws))


def looked_at(weighed: Sequence[Weighed], known: Around) -> Looked:
    """The effects with what each two of them share, to first order in both."""
    taken_up = np.stack([known.taken_up(one.changes) for one in weighed])
    return Looked(tuple(weighed), taken_up, _gain(weighed, taken_up))


@dataclass(frozen=True)
class Average:
    """Probabilities of what there is beside the model.

    Attributes
    ----------
    looked : Looked
    nothing : float
        Probability that there is nothing more.
    single : ndarray, shape (E,)
        That there is one.
    pair : ndarray, shape (E, E)
        That there are two, the first before the second; zero on and below the diagonal.
    """

    looked: Looked
    nothing: float
    single: Floats
    pair: Floats

    @property
    def present(self) -> Floats:
        """Probability that each effect is there, alone or not, shape (E,)."""
        return self.single + self.pair.sum(axis=0) + self.pair.sum(axis=1)

    def log_factors(self, count: int, rng: np.random.Generator) -> Floats:
        """Draws of what there is beside the model, as what it does to ln K_CR; shape (count,)."""
        first, second = np.nonzero(self.pair)
        factors = [one.log_factor for one in self.looked.weighed]
        shares = np.concatenate([[self.nothing], self.single, self.pair[first, second]])
        which = systematic(shares, count, rng)
        edges = np.searchsorted(which, np.arange(len(shares) + 1))
        out = np.zeros(count)
        for number, own in enumerate(factors, start=1):
            rows = slice(edges[number], edges[number + 1])
            out[rows] = own[rng.integers(KEPT, size=edges[number + 1] - edges[number])]
        for number, (a, b) in enumerate(zip(first, second, strict=True), start=len(factors) + 1):
            rows, size = slice(edges[number], edges[number + 1]), edges[number + 1] - edges[number]
            if size:
                weight = np.exp(self.looked.meeting(int(a), int(b)))
                i, j = np.divmod(
                    rng.permutation(systematic(weight.ravel(), size, rng)), len(weight)
                )
                out[rows] = factors[a][PAIRED * i] + factors[b][PAIRED * j]
        return rng.permutation(out)


def average(looked: Looked, prior: HiddenPrior) -> Average:
    """What there is beside the model, with its probabilities.

    An effect whose evidence is not known (no draw of it is possible) counts as excluded.
    """
    weighed, count = looked.weighed, len(looked.weighed)
    probability = np.array([one.share * prior.of(one.name) for one in weighed])
    evidence = np.array([one.log_evidence for one in weighed])
    with np.errstate(divide="ignore"):
        odds = np.log(probability) - np.log1p(-probability)
    single = odds + np.where(np.isfinite(evidence), evidence, -np.inf)
    names = np.array([one.name for one in weighed])
    pair = single[:, None] + single + looked.gain
    allowed = np.triu(np.ones((count, count), bool), 1) & (names[:, None] != names)
    pair = np.where(allowed, pair, -np.inf)
    top = max(0.0, float(single.max(initial=0.0)), float(pair.max(initial=0.0)))
    shares = np.exp(-top), np.exp(single - top), np.exp(pair - top)
    whole = sum(float(np.sum(share)) for share in shares)
    return Average(looked, float(shares[0] / whole), shares[1] / whole, shares[2] / whole)
