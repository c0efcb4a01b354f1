"""The posterior of one effect: its sizes, its evidence, and how far it moves the limit.

Sizes are drawn by what the regression says of them, the posterior's draws are moved along, and both
are weighed by the real likelihood and the real priors: importance sampling, whose weights' mean is
the evidence against nothing more (D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4,
1992, for what that is; A. Vehtari et al., JMLR 25, 2024, for how it is checked).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import logsumexp

from bayeshaptic.diagnosis.hidden.evidence import Evidence
from bayeshaptic.diagnosis.hidden.regression import Around, log_limits
from bayeshaptic.diagnosis.hidden.sizes import Sizes, sizes_of
from bayeshaptic.diagnosis.hidden.suspects import Suspect
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.numerics.pareto import pareto_k
from bayeshaptic.numerics.weights import normalised, systematic
from bayeshaptic.types import Floats, Ints

KEPT = 200  # equally weighted draws of an effect
PAIRED = 5  # every so many of them meet those of another effect
# Steps of Gauss and Newton towards where the parameters give way to: of few cases, and of many.
_STEPS, _FEW, _STEPS_EACH = 8, 200, 2


@dataclass(frozen=True)
class Weighed:
    """What the recording says of an effect, if it is there.

    Attributes
    ----------
    name, title, family, told_apart_by : str
        The effect's.
    what, unit : str
        What its strength is.
    place : str
        Which of the effect's places, or which of its laws.
    shared : str
        What recordings must have in common to say something of the same one, see `Suspect`.
    share : float
        Of the effect's prior probability.
    log_evidence : float
        Over that of nothing more.
    pareto_k : float
        Above 0.7 the evidence is not known.
    strength : ndarray, shape (KEPT,)
        Equally weighted draws.
    log_factor : ndarray, shape (KEPT,)
        What each does to ln K_CR.
    changes : ndarray, shape (KEPT / PAIRED, N)
        Of the residuals, before the parameters give way, by some of them.
    size, shape : ndarray, shapes (KEPT,), (KEPT, K)
        Of each draw, as other recordings of the device know them.
    evidence : Evidence or None
        Of every size; None where there is none for other recordings.
    """

    name: str
    title: str
    family: str
    told_apart_by: str
    what: str
    unit: str
    place: str
    shared: str
    share: float
    log_evidence: float
    pareto_k: float
    strength: Floats = field(repr=False)
    log_factor: Floats = field(repr=False)
    changes: Floats = field(repr=False)
    size: Floats = field(repr=False)
    shape: Floats = field(repr=False)
    evidence: Evidence | None = field(default=None, repr=False)

    def with_more(self, said: Floats, kept: Ints) -> Weighed:
        """The same with what others say of every size; `kept` are the draws left, in pairs too."""
        assert self.evidence is not None
        return replace(
            self,
            log_evidence=self.evidence.with_more(said),
            strength=self.strength[kept],
            log_factor=self.log_factor[kept],
            changes=self.changes[kept[::PAIRED] // PAIRED],
            size=self.size[kept],
            shape=self.shape[kept],
        )


def weigh(suspect: Suspect, known: Around, rng: np.random.Generator) -> Weighed:
    """The posterior of one effect.

    Sizes are drawn by the density where the parameters have given way to each, and draws of the
    posterior, moved along, are weighed by the real one (importance sampling).

    Parameters
    ----------
    suspect : Suspect
    known : Around
        The posterior without the effect.
    rng : numpy.random.Generator

    Returns
    -------
    Weighed
    """
    sizes = sizes_of(suspect, known)
    moved, changes = _followed(suspect, known, sizes.own)
    said = np.log(sizes.weight)
    if suspect.tested is not None:
        said = said + suspect.tested.log_likelihood(sizes.strength)
    there = known.centre + moved
    vectors = suspect.vectors(known.natural(there), sizes.own)
    guess = known.density(suspect.model, vectors, there)
    cells, log_share = _drawn(said + guess, len(known.phi), rng)
    phi = known.phi + moved[cells]
    theta = known.natural(phi)
    vectors = suspect.vectors(theta, sizes.own[cells])
    target = known.density(suspect.model, vectors, phi)
    log_weight = said[cells] - log_share + target - known.log_density
    possible = np.isfinite(log_weight)
    top = float(log_weight.max())
    weight = np.exp(log_weight - top) if np.isfinite(top) else np.full(len(phi), 1.0)
    evidence = top + float(np.log(weight.mean()))
    kept = rng.permutation(systematic(weight, KEPT, rng))
    excluded = not np.isfinite(top)  # no draw is possible
    factor = np.zeros(KEPT) if excluded else _log_factor(suspect, known, vectors, theta, kept)
    size = sizes.strength * suspect.unit_size
    others = None
    if suspect.shared and not excluded:
        log = guess + said - np.log(sizes.weight)
        log = log - (float(logsumexp(said + guess)) - evidence)
        others = _of_every_size(sizes, size, log, known, there)
    return Weighed(
        name=suspect.name,
        title=suspect.title,
        family=suspect.family,
        told_apart_by=suspect.told_apart_by,
        what=suspect.unseen.title,
        unit=unit_of(suspect.unseen.dimension, suspect.base.force_unit, suspect.base.position_unit),
        place=suspect.place,
        shared=suspect.shared,
        share=suspect.share,
        log_evidence=evidence,
        pareto_k=pareto_k(log_weight[possible]) if possible.sum() > 50 else np.inf,
        strength=sizes.strength[cells][kept],
        log_factor=factor,
        changes=changes[cells[kept[::PAIRED]]],
        size=size[cells][kept],
        shape=sizes.shape[cells][kept],
        evidence=others,
    )


def _of_every_size(
    sizes: Sizes, size: Floats, log: Floats, known: Around, there: Floats
) -> Evidence:
    """The evidence of every size, to be used by other recordings of the device.

    Parameters
    ----------
    sizes : Sizes
    size : ndarray, shape (C,)
        As other recordings know them.
    log : ndarray, shape (C,)
        The log evidence of each.
    known : Around
    there : ndarray, shape (C, P)
        Where the parameters go with each.
    """
    least_log = -1e3  # log evidence: less is as impossible
    before = known.log_prior(known.centre[None])
    with np.errstate(invalid="ignore"):  # outside of the support
        data = np.where(np.isfinite(log), log - known.log_prior(there) + before, -np.inf)
    log, data = np.maximum(log, least_log), np.maximum(data, least_log)
    return Evidence(size, sizes.shape, sizes.weight, log, data)


def _followed(suspect: Suspect, known: Around, own: Floats) -> tuple[Floats, Floats]:
    """Where the parameters go with every size of an effect, (C, P); what changed, (C, N)."""
    moved = np.zeros((len(own), len(known.centre)))
    for _ in range(_STEPS if len(own) <= _FEW else _STEPS_EACH):
        vectors = suspect.vectors(known.natural(known.centre + moved), own)
        changes = known.changes(suspect.model, vectors, moved)
        before, moved = moved, known.moved(changes)
        if known.close(moved, before):
            break
    return moved, changes


def _drawn(log_weight: Floats, count: int, rng: np.random.Generator) -> tuple[Ints, Floats]:
    """Indices of cells drawn by weight, some by a flatter one, and the log probability of each."""
    bold = 0.25  # share of the sizes that are drawn from the flatter distribution
    share = (1 - bold) * normalised(log_weight) + bold * normalised(0.5 * log_weight)
    cells = rng.permutation(systematic(share, count, rng))
    return cells, np.log(share[cells])


def _log_factor(
    suspect: Suspect, known: Around, vectors: Floats, theta: Floats, kept: Ints
) -> Floats:
    """ln K_CR of the kept draws over that of the same draws without the effect.

    What the weights alone do to the parameters, which a factor on every draw would not show, is
    added to it on average.
    """
    used, place = np.unique(kept, return_inverse=True)
    own = known.log_limit
    if suspect.counts:
        new = log_limits(suspect.model, vectors[used])
    else:
        new = log_limits(known.model, theta[used])
    with np.errstate(invalid="ignore"):
        farthest = 5.0  # log stiffness: a factor of 150 either way is far enough
        factor = np.clip(new - own[used], -farthest, farthest)
    factor = np.where(np.isnan(factor), 0.0, factor)
    drift = float(own[kept].mean() - own.mean()) if np.isfinite(own).all() else 0.0
    return np.asarray(factor[place] + drift)
