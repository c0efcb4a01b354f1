"""Choosing between rigid, free and grasped, and saying why."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices import Device
from bayeshaptic.inference.fit import MISFIT, Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import Prior, build_model
from bayeshaptic.models.structures import STRUCTURES
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown
from bayeshaptic.threads import single_threaded

_MATERIAL = 2.0  # a richer model that misfits too must cut the squared residual by this factor
_WORDS = {
    "rigid": "one rigid mass",
    "free": "two masses and a transmission, held by nobody",
    "grasped": "a device held by a user",
}


@dataclass(frozen=True)
class ScoredFit:
    """A base model that was tried.

    Attributes
    ----------
    fit : Fit
    score : float
        Bayesian information criterion, with the residual of the best candidate as the noise where
        that exceeds the noise (a quasi-likelihood); smaller is better.
    """

    fit: Fit
    score: float


@dataclass(frozen=True, repr=False)
class Choice(Shown):
    """The chosen base model and the reason in words.

    Attributes
    ----------
    fit : Fit
    reason : str
    candidates : mapping
        Name of the model to what it scored.
    """

    fit: Fit
    reason: str
    candidates: Mapping[str, ScoredFit]

    def _lines(self) -> tuple[str, ...]:
        others = ", ".join(name for name in self.candidates if name != self.fit.model.name)
        return f"Chosen model: {self.fit.model.name}", self.reason, f"compared with: {others}"


@at_the_door
@single_threaded
def choose_model(
    etfe: Etfe,
    device: Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
    held: bool | None = None,
    seed: int = 0,
) -> Choice:
    """Fit the rigid, the free and the grasped model and choose by an information criterion.

    Parameters
    ----------
    etfe : Etfe
    device : Device, optional
    delay_s, delay_sd_s : float, optional
        The loop delay and its standard deviation, where they are known.
    prior : mapping, optional
        The user's own priors; those that a candidate has no parameter for are left aside.
    held : bool, optional
        Whether somebody held the device, where the study says so: then it is not a question.
    seed : int

    Returns
    -------
    Choice
    """
    names = {None: list(STRUCTURES), True: ["grasped"], False: ["rigid", "free"]}[held]
    fits = {}
    for name in names:
        model = build_model(name, device, delay_s, delay_sd_s, etfe.period_s)
        own = {key: value for key, value in (prior or {}).items() if key in model.names}
        fits[name] = least_squares(model.with_prior(own), etfe, seed=seed)
    noise = max(1.0, min(fit.reduced_chi_square for fit in fits.values()))
    candidates = {
        name: ScoredFit(fit, information_criterion(fit, noise)) for name, fit in fits.items()
    }
    best = _best(candidates, noise)
    return Choice(fits[best], _reason(best, candidates, noise, held), candidates)


def _best(candidates: Mapping[str, ScoredFit], noise: float) -> str:
    """The simplest model that no richer one beats.

    Where no candidate reaches the noise, more parameters always help a little, by standing in for
    something else; then a richer model must also halve the squared residual.
    """
    ordered = sorted(candidates, key=lambda name: candidates[name].fit.model.size)
    best = ordered[0]
    for name in ordered[1:]:
        better = candidates[name].score < candidates[best].score
        gain = candidates[best].fit.reduced_chi_square / candidates[name].fit.reduced_chi_square
        if better and (noise < MISFIT or gain > _MATERIAL):
            best = name
    return best


def information_criterion(fit: Fit, noise: float, further: int = 0) -> float:
    """Bayesian information criterion of a fit; smaller is better.

    Parameters
    ----------
    fit : Fit
    noise : float
        Factor on the noise variance (a quasi-likelihood where no model reaches the noise).
    further : int
        Parameters beside those of the fit's model.
    """
    numbers = 2 * len(fit.residual)
    deviance = 2 * float(np.sum(np.abs(fit.residual) ** 2)) / noise
    return deviance + (fit.model.size + further) * float(np.log(numbers))


def _reason(best: str, candidates: Mapping[str, ScoredFit], noise: float, held: bool | None) -> str:
    chosen = candidates[best].fit
    said = ""
    if held is not None:
        said = "The study says that somebody held it. " if held else "The study names no user. "
    text = (
        f"{said}Chosen: {best} ({_WORDS[best]}, {chosen.model.size} parameters), "
        f"reduced chi-square {_plain(chosen.reduced_chi_square)}."
    )
    for name, other in candidates.items():
        if name == best:
            continue
        behind = other.score - candidates[best].score
        text += (
            f" {name.capitalize()} ({other.fit.model.size} parameters) has "
            f"{_plain(other.fit.reduced_chi_square)}, and an information criterion (BIC) "
            f"{_plain(abs(behind))} {'worse' if behind > 0 else 'better'}."
        )
    if noise >= MISFIT:
        text += (
            f" No candidate reaches the noise: the criterion takes {_plain(noise)} times its "
            "variance, and a richer model must also halve the squared residual, or it only stands "
            "in for what is missing."
        )
    return text


def _plain(value: float) -> str:
    """Three digits without powers of ten."""
    return f"{float(f'{value:.3g}'):,.10g}"
