"""How else it could be: the limit over all effects that explain a recording as well.

Each has the draws of its own posterior, and counts by its evidence: importance sampling around
its peak, with the priors of the base model's parameters.  An effect's own parameters cost half the
log of the number of windows each (G. Schwarz, "Estimating the dimension of a model", Annals of
Statistics 6, 1978): priors of a library in which a lag is to be found that is a period, or a
hundredth of one, do not say which of two effects it is.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.diagnosis.state import cost, worth
from bayeshaptic.diagnosis.traced import Traced
from bayeshaptic.inference.coordinates import Coordinates, sampling_coordinates
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.sampling.density import Density
from bayeshaptic.inference.sampling.laplace import laplace
from bayeshaptic.inference.sampling.near_zero import resolved, start_of, with_near_zero
from bayeshaptic.models import Model
from bayeshaptic.numerics.pareto import pareto_k
from bayeshaptic.numerics.weights import normalised, systematic, truncated
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.mixed import mixed
from bayeshaptic.types import Floats

_NEAR = 8.0  # of log likelihood behind the best: what is further behind has no weight


@dataclass(frozen=True)
class Rival:
    """One explanation.

    Attributes
    ----------
    name : str
        Of the effect.
    log_evidence : float
        Up to a constant that all have.
    pareto_k : float
        Of the importance weights; above 0.7 the evidence is rough.
    limit : CriticalStiffness
    """

    name: str
    log_evidence: float
    pareto_k: float
    limit: CriticalStiffness = field(repr=False)


def with_rivals(
    limit: CriticalStiffness, traced: Traced, seed: int = 0
) -> tuple[CriticalStiffness, Traced]:
    """The limit averaged over the last linear effect and its rivals, and their probabilities.

    The average takes the place of what ties add to the spread of the limit.  Where another kind of
    effect was accepted last, limit and record stay as they are: each rival would be fitted to other
    data after a law was taken off.

    Parameters
    ----------
    limit : CriticalStiffness
        With the accepted effects.
    traced : Traced
    seed : int
    """
    *earlier, own = traced.state.accepted or (None,)
    if own is None or own.family != "linear":
        return limit, traced
    rng = np.random.default_rng([seed, 151])
    found = rivals(own.name, traced, rng)
    if found is None:
        return limit, traced
    shares = normalised(np.array([one.log_evidence for one in found])) if found else np.ones(1)
    own = replace(own, limit_log_sd=0.0)
    if found:
        names = [one.name for one in found]
        own = replace(own, probabilities=dict(zip(names, shares.tolist(), strict=True)))
        limits = [one.limit for one in found[1:]]
        limit = mixed(limit, limits, shares[1:].tolist(), names[1:], rng)
    state = replace(traced.state, accepted=(*earlier, own))
    return limit, replace(traced, state=state)


def rivals(name: str, traced: Traced, rng: np.random.Generator) -> list[Rival] | None:
    """The accepted explanation first, then those near it; none where there are none.

    None where the accepted one cannot be weighed.

    Parameters
    ----------
    name : str
        Of the effect that was accepted last.
    traced : Traced
    rng : numpy.random.Generator
    """
    here = traced.state.fit
    others = [t for t in traced.rejected if t.accepted.family == "linear"]
    fits = [here, *(t.state.fit for t in others)]
    value = np.array([worth(replace(fit, windows=here.windows)) for fit in fits])
    near = np.flatnonzero(value > value.max() - _NEAR)
    chosen = sorted({0, *near.tolist()})
    if len(chosen) < 2:
        return []
    names = [name, *(t.name for t in others)]
    found = [_rival(names[i], fits[i], here.windows, rng) for i in chosen]
    return None if found[0] is None else [one for one in found if one is not None]


def _own(model: Model) -> list[str]:
    """Parameters of effects."""
    return [p.name for effect in model.effects for p in effect.parameters]


def _rival(name: str, fit: Fit, windows: Windows, rng: np.random.Generator) -> Rival | None:
    draws, kept = 3000, 500
    fit = resolved(fit)
    here = with_near_zero(sampling_coordinates(fit.model, fit.theta, fit.sd), fit)
    density = Density(Likelihood(fit.model, windows), here)
    _, proposal = laplace(density, start_of(here, fit))
    phi = proposal.sample(rng, draws)
    log_weight = density(phi) - proposal.log_density(phi)
    possible = np.isfinite(log_weight)
    if not possible.any():
        return None
    k = pareto_k(log_weight[possible])
    log_weight = truncated(log_weight)
    top = log_weight.max()
    evidence = float(top + np.log(np.mean(np.exp(log_weight - top)))) + _constant(here)
    phi = phi[systematic(np.exp(log_weight - top), kept, rng)]
    evidence -= _taken(fit.model, here, phi) + cost(replace(fit, windows=windows))
    return Rival(name, evidence, k, critical_stiffness(fit.model, here.natural(phi)))


def _constant(here: Coordinates) -> float:
    """What `Coordinates.log_jacobian` leaves out, which differs between models."""
    return float(np.log(here.scale[~here.log]).sum() + np.log(here.floor).sum())


def _taken(model: Model, here: Coordinates, phi: Floats) -> float:
    """Log of the share of the effect parameters' prior that their posterior takes up."""
    own = _own(model)
    places = [model.names.index(name) for name in own]
    coordinate = here.own(phi)[:, places]
    middle = coordinate.mean(axis=0)
    log = here.log[places]
    with np.errstate(over="ignore"):
        value = np.where(log, np.exp(np.where(log, middle, 0.0)), middle * here.scale[places])
    stretch = np.where(log, value, here.scale[places])
    density = [float(model.prior(n).log_density(v)) for n, v in zip(own, value, strict=True)]
    spread = np.atleast_2d(np.cov(coordinate, rowvar=False))
    volume = 0.5 * np.linalg.slogdet(2 * np.pi * spread)[1]
    return min(float(np.sum(density) + np.log(stretch).sum() + volume), 0.0)
