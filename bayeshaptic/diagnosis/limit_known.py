"""What a report asks of its sampler: that the limit is known, not every parameter equally well."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.options import Options
from bayeshaptic.inference.diagnostics import RHAT_LIMIT, Diagnostics, diagnose
from bayeshaptic.inference.posterior import prior_dominated
from bayeshaptic.inference.sampling.settings import MOST_EVALUATIONS, SamplerSettings
from bayeshaptic.inference.sampling.stopping import EveryParameter, Verdict
from bayeshaptic.models import Model
from bayeshaptic.numerics.rank_statistics import split_rhat
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.draws import most_draws
from bayeshaptic.stability.tail import ENOUGH_BELOW, quantile_with_error
from bayeshaptic.types import Floats

QUANTILES = (0.05, 0.5, 0.95)
SMALL_RISKS = (0.01, 0.001)
PRECISION = 0.05  # Monte-Carlo error of a quantile of K_CR, as a share of its 90 % interval
# Of a small risk's: what a fitted tail states is cautious, some 1.5 times the error that it has.
# And of any quantile where evaluations run out: that much is a third of a standard deviation, and
# of intervals of 90 % 88.2 % hold at worst.
RISK_PRECISION = 0.1
EFFECTIVE = 400.0  # effective draws of every parameter, those of the prior's opinion included
_CERTAIN = 4000.0  # effective draws that make any quantile known well enough, in a gap too
_MOST_FOR_RISKS = 60_000  # draws after which a small risk is stated as it can be, or not at all
# The limit is not looked at yet below this share of a parameter's draws, or above this R-hat.
_HOPELESS, _APART = 0.25, 1.02


@dataclass(frozen=True)
class _Chains:
    """What `critical_stiffness` reads of a posterior."""

    model: Model
    chains: Floats


@dataclass
class LimitKnown:
    """The rule of a report; see `docs/statistics.md`, Sampling.

    The Monte-Carlo error of every reported quantile of K_CR is below 5 % of its 90 % interval (or
    the quantile is counted from 4000 effective draws), that of a small risk's below 10 %; R-hat of
    K_CR and of every parameter that the data know is below 1.01; every parameter has 400 effective
    draws.  Where evaluations run out before that, 10 % will do for quantiles, too; and before a
    small risk is known so, the rest is known all the same: that risk is stated as it can be, or not
    at all.

    Attributes
    ----------
    model : Model
    risks : tuple of float
        Small ones that are to be stated, too.
    limit : CriticalStiffness or None
        Of the chains that were seen last.
    """

    model: Model
    risks: tuple[float, ...] = SMALL_RISKS
    limit: CriticalStiffness | None = field(default=None, init=False)
    _seen: Floats = field(default_factory=lambda: np.empty((0, 0)), init=False)

    @property
    def key(self) -> str:
        return f"limit known {self.risks!r}"

    def __call__(self, chains: Floats) -> Verdict:
        found = diagnose(chains, EFFECTIVE)
        share = found.ess / EFFECTIVE
        if share < _HOPELESS or np.median(found.rhat) > _APART:
            return self._verdict(found, False, share, share, "the limit was not looked at")
        limit = self._limit(chains)
        data = ~np.array(prior_dominated(self.model, chains.reshape(-1, chains.shape[-1])))
        rhat = max([_rhat(limit, chains), *found.rhat[data]])
        error, worth = _worst(limit, QUANTILES)
        risky = self._risks(limit, chains)
        known = rhat < RHAT_LIMIT and share >= 1 and (worth >= 1 or error < RISK_PRECISION)
        facts = (
            f"every reported quantile of the critical stiffness is known to {100 * error:.1f} % of "
            "its 90 % interval, R-hat between the independent ensembles is at most "
            f"{rhat:.4f} (of the critical stiffness and of what the data know)"
        )
        return self._verdict(found, known, min(share, worth), risky, facts)

    def limit_of(self, posterior: Any) -> CriticalStiffness:
        """The limit over all draws of `posterior`, whose chains were watched."""
        if self.limit is not None and np.array_equal(self._seen, posterior.chains):
            return self.limit
        return critical_stiffness(posterior, before=self._before(posterior.chains))

    def _limit(self, chains: Floats) -> CriticalStiffness:
        """What has been found of the same chains is not searched again."""
        before = self._before(chains)
        self._seen = chains
        self.limit = critical_stiffness(_Chains(self.model, chains), before=before)
        return self.limit

    def _before(self, chains: Floats) -> CriticalStiffness | None:
        """What was found of these chains while they were shorter.

        None of others: a proposal that is fitted again begins new ones, which may never be looked
        at because they do not converge, and of chains that mix badly every other step is thrown
        away.  All steps are compared: walkers that have not moved yet begin alike.
        """
        steps = min(self._seen.shape[1], chains.shape[1])
        same = self.limit is not None and np.array_equal(self._seen[:, :steps], chains[:, :steps])
        return self.limit if same else None

    def _risks(self, limit: CriticalStiffness, chains: Floats) -> float:
        """Share of the draws that the small risks want; 1 where no more can be afforded."""
        draws = chains[..., 0].size
        if draws >= min(_MOST_FOR_RISKS, most_draws(self.model, chains[0, 0, 0])):
            return 1.0
        width = _width(limit)
        shares = [1.0]
        for risk in self.risks:
            below = limit.effective_below(risk) / ENOUGH_BELOW
            tail = limit.low_quantile(risk)
            if tail is not None and tail.error > 0:
                shares.append(max(below, (RISK_PRECISION * width / tail.error) ** 2))
            elif tail is None:
                shares.append(below)
        return min(shares)

    def _verdict(
        self, found: Diagnostics, known: bool, share: float, risky: float, facts: str
    ) -> Verdict:
        fewest = self.model.names[int(np.argmin(found.fewest))]
        facts += f", and every parameter has at least {found.ess:.0f} effective draws ({fewest})"
        asked = f"{PRECISION:.0%}, {RHAT_LIMIT} and {EFFECTIVE:.0f}"
        done = bool(known and min(share, risky) >= 1)
        return Verdict(found, bool(known), done, min(share, risky), facts, asked)


def asked_of_sampler(
    watch: LimitKnown, options: Options, most_evaluations: int = MOST_EVALUATIONS
) -> SamplerSettings:
    """What an analysis asks of its sampler: that the limit is known, if nobody asks for more.

    Parameters
    ----------
    watch : LimitKnown
    options : Options
        Where `ess` is given, that many effective draws of every parameter are asked for instead.
    most_evaluations : int
    """
    rule = watch if options.ess is None else EveryParameter(watch.model, options.ess)
    return SamplerSettings(
        rule, options.seed, options.report, options.checkpoints, most_evaluations
    )


def _width(limit: CriticalStiffness) -> float:
    low, high = limit.quantile([0.05, 0.95])
    return float(high - low) if np.isfinite(high) else np.inf


def _worst(limit: CriticalStiffness, levels: tuple[float, ...]) -> tuple[float, float]:
    """The largest error of a quantile over the 90 % interval; share of the draws wanted."""
    ordered, width = np.sort(limit.samples), _width(limit)
    errors, shares = [0.0], [np.inf]
    for level in levels:
        found = quantile_with_error(ordered, level, limit.effective_at)
        if found.error > 0 and np.isfinite(found.error) and width > 0:
            errors.append(found.error / width)
            certain = limit.effective_at(found.value) / _CERTAIN
            shares.append(max((PRECISION / errors[-1]) ** 2 if width < np.inf else 1.0, certain))
    return max(errors), min(shares)


def _rhat(limit: CriticalStiffness, chains: Floats) -> float:
    """R-hat of K_CR between the ensembles, by its ranks: some draws may be infinite."""
    ensembles, _, walkers, _ = chains.shape
    ranks = np.unique(limit.samples, return_inverse=True)[1].astype(float)
    if np.ptp(ranks) == 0:
        return 1.0
    by_time = ranks.reshape(ensembles, walkers, -1).swapaxes(1, 2)
    return split_rhat(by_time.reshape(ensembles, -1))
