"""What may be behind a residual: a system for each vector of prior coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.models import LinearSystem
from bayeshaptic.models.structures import STRUCTURES
from bayeshaptic.stability import find_crossings
from bayeshaptic.types import Floats

from .evidence import Evidence, evidence
from .published import delay_s, values
from .relay_data import PERIOD_S, RelayData

Values = dict[str, Floats]


@dataclass(frozen=True)
class Unknown:
    """A quantity with a log-normal prior: median exp(log_sd z)."""

    name: str
    median: float
    log_sd: float


@dataclass(frozen=True)
class Hypothesis:
    """The published parameters with a spread, and something more.

    Attributes
    ----------
    title : str
    case : tuple of str
        Device and model.
    spread : float
        Log standard deviation of every published parameter; a zero damper is half-normal, its scale
        the spread times the largest damper to the ground.
    wider : mapping
        Other spreads, by name.
    extra : tuple of Unknown
    add : callable
        (system, values) -> system with what is more.
    known : callable, optional
        Log density, for each system, of what is known besides; it belongs to the prior.
    """

    title: str
    case: tuple[str, str]
    spread: float
    wider: Mapping[str, float] = field(default_factory=dict)
    extra: tuple[Unknown, ...] = ()
    add: Callable[[LinearSystem, Values], LinearSystem] = lambda system, values: system
    known: Callable[[LinearSystem], Floats] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        return (*values(*self.case), *(unknown.name for unknown in self.extra))

    def values(self, z: Floats) -> Values:
        """Every quantity for prior coordinates `z`, shape (B, size)."""
        published = values(*self.case)
        floor = max(published["b1"], published["b2"])
        found: Values = {}
        for (name, value), column in zip(published.items(), z.T, strict=False):
            spread = self.wider.get(name, self.spread)
            found[name] = (
                value * np.exp(spread * column) if value else floor * spread * np.abs(column)
            )
        for unknown, column in zip(self.extra, z.T[len(published) :], strict=True):
            found[unknown.name] = unknown.median * np.exp(unknown.log_sd * column)
        return found

    def system(self, z: Floats) -> LinearSystem:
        found = self.values(z)
        mechanism = STRUCTURES[self.case[1]].build(found)
        plain = LinearSystem(mechanism, np.full(len(z), delay_s(self.case[0])))
        return self.add(plain, found)

    def limits(self, z: Floats) -> tuple[Floats, Floats]:
        """K_CR in dB and its frequency, shape (B,) each."""
        found = find_crossings(self.system(z), PERIOD_S)
        with np.errstate(divide="ignore"):
            return 20 * np.log10(found.critical), found.binding_hz


@dataclass(frozen=True)
class Weighed:
    """A hypothesis with its evidence."""

    hypothesis: Hypothesis
    evidence: Evidence
    prior_db: Floats = field(repr=False)
    posterior_db: Floats = field(repr=False)
    posterior_hz: Floats = field(repr=False)

    def factors(self) -> dict[str, Floats]:
        """Quantiles 5, 50, 95 % of the posterior of every quantity, published ones as factors."""
        published = values(*self.hypothesis.case)
        draws = self.hypothesis.values(self.evidence.draws)
        return {
            name: np.quantile(column / (published.get(name) or 1.0), [0.05, 0.5, 0.95])
            for name, column in draws.items()
        }


def weigh(hypotheses: Sequence[Hypothesis], data: RelayData, seed: int = 0) -> list[Weighed]:
    """The evidence of each, and K_CR before and after."""
    return [_weighed(hypothesis, data, seed) for hypothesis in hypotheses]


def _weighed(hypothesis: Hypothesis, data: RelayData, seed: int) -> Weighed:
    """With what is known besides, the evidence is that of all over that of what is known."""
    size, known = len(hypothesis.names), hypothesis.known

    def log_likelihood(z: Floats) -> Floats:
        system = hypothesis.system(z)
        with np.errstate(all="ignore"):
            relay = data.log_likelihood(system).sum(axis=1)
        return relay if known is None else relay + known(system)

    found = evidence(log_likelihood, size, seed)
    before = np.random.default_rng(seed).standard_normal((1000, size))
    if known is not None:
        prior = evidence(lambda z: known(hypothesis.system(z)), size, seed)
        found = replace(
            found,
            log_evidence=found.log_evidence - prior.log_evidence,
            sd=float(np.hypot(found.sd, prior.sd)),
        )
        before = prior.draws[:1000]
    after, frequency = hypothesis.limits(found.draws[:1000])
    return Weighed(hypothesis, found, hypothesis.limits(before)[0], after, frequency)
