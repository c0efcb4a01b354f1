"""The limit that allows for what the tests of a recording cannot see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.diagnosis.hidden.average import Average, Looked, average, looked_at
from bayeshaptic.diagnosis.hidden.drift import drifts, weigh_drift
from bayeshaptic.diagnosis.hidden.forces import force_suspects
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.hidden.regression import Around, around
from bayeshaptic.diagnosis.hidden.suspects import linear_suspects
from bayeshaptic.diagnosis.hidden.weighed import Weighed, weigh
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown, listed
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.types import Bools, Floats

DRAWS = 400  # of the posterior that every effect is weighed with
SENSITIVITY = (0.5, 2.0)  # factors on the prior probabilities


@dataclass(frozen=True)
class HiddenEffect:
    """What one effect could be, unseen, and do to the limit.

    Attributes
    ----------
    name, title, family, told_apart_by : str
        The effect's.
    prior, probability : float
        That it is there, before and after the recording was looked at.
    what, unit : str
        What its strength is.
    strength_q95 : float
        With a probability of 95 % it is no larger, if it is there.
    shift_db : tuple of float
        What it does to K_CR, if it is there: 5 %, 50 % and 95 % points, dB.
    pareto_k : float
        Of the importance weights; above 0.7 these numbers are rough.
    """

    name: str
    title: str
    family: str
    told_apart_by: str
    prior: float
    probability: float
    what: str
    unit: str
    strength_q95: float
    shift_db: tuple[float, float, float]
    pareto_k: float


@dataclass(frozen=True, eq=False, repr=False)
class Hidden(Shown):
    """What could hide in a recording.

    Attributes
    ----------
    declared : CriticalStiffness
        The limit if the model is exact.
    nothing : float
        Probability that there is nothing more, given the recording.
    effects : tuple of HiddenEffect
        The one that lowers the limit most comes first.
    prior : HiddenPrior
    sensitivity : mapping
        Factor on the prior probabilities to 1, 5, 50 and 95 % points of K_CR.
    looked : Looked
        Every effect that was looked at, at every place.
    """

    declared: CriticalStiffness = field(repr=False)
    nothing: float
    effects: tuple[HiddenEffect, ...]
    prior: HiddenPrior
    sensitivity: dict[float, tuple[float, ...]]
    looked: Looked = field(repr=False)

    def _lines(self) -> tuple[str, ...]:
        told = [f"{one.title} ({percent(one.probability)})" for one in self.effects]
        return (
            f"What could hide: nothing with a probability of {percent(self.nothing)}",
            f"what would move the limit most: {listed(told, 2) or 'nothing'}",
        )


def with_hidden(
    limit: CriticalStiffness,
    posterior: Posterior,
    etfe: Etfe,
    tests: Sequence[Test],
    found: Sequence[str],
    prior: HiddenPrior,
    seed: int = 0,
) -> tuple[CriticalStiffness, Hidden] | None:
    """The limit averaged over what could hide, and what that is.

    None where no effect has a probability, and where the posterior does not come from windows of a
    response: there is nothing to weigh an effect with.

    Parameters
    ----------
    limit : CriticalStiffness
        Of the declared model, and the accepted effects.
    posterior : Posterior
    etfe : Etfe
    tests : sequence of Test
        Of the residual that is left.
    found : sequence of str
        Names of the accepted effects: these do not hide.
    prior : HiddenPrior
    seed : int
    """
    if posterior.windows is None:
        return None
    rng = np.random.default_rng([seed, 15])
    known = around(posterior, DRAWS, rng)
    weighed = _weighed(known, etfe, tests, found, prior, rng)
    if not weighed:
        return None
    return averaged(limit, looked_at(weighed, known), prior, rng)


def averaged(
    limit: CriticalStiffness, looked: Looked, prior: HiddenPrior, rng: np.random.Generator
) -> tuple[CriticalStiffness, Hidden]:
    """The limit averaged over effects that were looked at, and what these are.

    Parameters
    ----------
    limit : CriticalStiffness
        Of the declared model.
    looked : Looked
    prior : HiddenPrior
    rng : numpy.random.Generator
    """
    own = _parts(limit, looked, prior)
    samples = _moved(limit, own, rng)
    sensitivity = {}
    for factor in SENSITIVITY:
        moved = _moved(limit, _parts(limit, looked, prior.times(factor)), rng)
        levels = replace(limit, samples=moved).quantile([0.01, 0.05, 0.5, 0.95])
        sensitivity[factor] = tuple(float(level) for level in levels)
    shares = np.array([np.mean(rows) for rows, _ in own])
    nothing = float(shares @ [one.nothing for _, one in own])
    present = shares @ [one.present for _, one in own]
    found = Hidden(limit, nothing, _effects(looked, present, prior), prior, sensitivity, looked)
    return replace(limit, samples=samples), found


def _parts(
    limit: CriticalStiffness, looked: Looked, prior: HiddenPrior
) -> list[tuple[Bools, Average]]:
    """What hides beside each explanation, and which draws of the limit belong to it.

    A rival of the accepted effect does not hide beside itself, where it would count twice.
    """
    which = limit.explained_by
    if which is None:
        return [(np.ones(len(limit.samples), bool), average(looked, prior))]
    priors = [prior, *(prior.without(name) for name in limit.explanations)]
    return [(which == number, average(looked, own)) for number, own in enumerate(priors)]


def _moved(
    limit: CriticalStiffness, parts: Sequence[tuple[Bools, Average]], rng: np.random.Generator
) -> Floats:
    """Draws of the limit with what hides beside each."""
    log = np.zeros(len(limit.samples))
    for rows, own in parts:
        log[rows] = own.log_factors(int(rows.sum()), rng)
    return np.asarray(limit.samples * np.exp(log))


def _weighed(
    known: Around,
    etfe: Etfe,
    tests: Sequence[Test],
    found: Sequence[str],
    prior: HiddenPrior,
    rng: np.random.Generator,
) -> list[Weighed]:
    model = known.model
    rms = float(np.std(etfe.recording.force)) if etfe.recording is not None else 0.0
    suspects = (*linear_suspects(model, etfe), *force_suspects(model, tests, found, rms))
    every = [weigh(one, known, rng) for one in suspects if prior.of(one.name) > 0]
    return every + [
        weigh_drift(one, known, rng)
        for one in drifts(model)
        if prior.of(one.name) > 0 and one.name not in found
    ]


def _effects(looked: Looked, present: Floats, prior: HiddenPrior) -> tuple[HiddenEffect, ...]:
    """One row for each effect, all its places together."""
    rows, weighed = [], looked.weighed
    for name in dict.fromkeys(one.name for one in weighed):
        places = [i for i, one in enumerate(weighed) if one.name == name]
        share = present[places] / max(float(present[places].sum()), 1e-300)
        strength, factor = _pooled(weighed, places, share)
        first = weighed[places[int(np.argmax(share))]]
        rows.append(
            HiddenEffect(
                name,
                first.title,
                first.family,
                first.told_apart_by,
                prior.of(name),
                float(present[places].sum()),
                first.what,
                first.unit,
                float(_quantile(np.abs(strength), 0.95)),
                tuple(float(20 / np.log(10) * q) for q in _quantile(factor, [0.05, 0.5, 0.95])),  # type: ignore[arg-type]
                max(weighed[i].pareto_k for i in places),
            )
        )
    return tuple(sorted(rows, key=_widening, reverse=True))


def _pooled(weighed: Sequence[Weighed], places: list[int], share: Floats) -> tuple[Floats, Floats]:
    """Strengths and factors of an effect's places, as many of each as its probability says."""
    strength, factor = [], []
    for place, part in zip(places, share, strict=True):
        one = weighed[place]
        kept = np.linspace(0, len(one.strength) - 1, round(part * len(one.strength))).astype(int)
        strength.append(one.strength[kept])
        factor.append(one.log_factor[kept])
    return np.concatenate(strength), np.concatenate(factor)


def _quantile(values: Floats, levels: float | list[float]) -> Floats:
    return np.asarray(np.quantile(values, levels)) if len(values) else np.zeros(np.shape(levels))


def _widening(effect: HiddenEffect) -> float:
    """A key by which the effect comes first that lowers the limit most."""
    low, _, high = effect.shift_db
    return effect.probability * (max(-low, 0.0) + 0.1 * max(high, 0.0))
