"""Choosing between rigid, free, a chain of three masses and grasped, and saying why.

A third mass looks like a hand: what tells them apart is that an arm holds the hand to the ground,
and what hands are like.  So a chain is among the candidates, and the hand of a grasped device
counts by how far it is from any, as five more residuals.  Where no transmission shows, a grasped
device counts as one mass in a hand.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices import Device
from bayeshaptic.inference.criterion import ScoredFit, deviance, information_criterion
from bayeshaptic.inference.fit import MISFIT, Fit
from bayeshaptic.inference.least_squares import SETS, continued, least_squares
from bayeshaptic.inference.loop_response import fitted_to_the_loop
from bayeshaptic.models import Prior, build_model
from bayeshaptic.models.build import with_force_sensor
from bayeshaptic.models.chains import as_three_masses, as_two_masses
from bayeshaptic.models.prior_table import refuse_unknown
from bayeshaptic.models.structures import GRASPED, ONE_IN_A_HAND
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats

# Information criteria nearer than this, odds of twenty to one, leave open which model it is.
UNDECIDED = 6.0
_CHAIN = "chain-2"
_NOISE = 1.1  # reduced chi-square: 5 of 80 clean recordings lie above, and only take longer
_WORDS = {
    "rigid": "one rigid mass",
    "free": "two masses and a transmission, held by nobody",
    "chain-2": "three masses in a row, held by nobody",
    "grasped": "a device held by a user",
}
CANDIDATES = tuple(_WORDS)


@dataclass(frozen=True, eq=False, repr=False)
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

    @property
    def undecided(self) -> tuple[str, ...]:
        """Candidates as good as the chosen one that differ from it in whether somebody holds it."""
        chosen = self.candidates[self.fit.model.name]
        return tuple(
            name
            for name, other in self.candidates.items()
            if other.held != chosen.held and abs(other.score - chosen.score) < UNDECIDED
        )

    def _lines(self) -> tuple[str, ...]:
        chosen = self.fit.model.name
        worse = ", ".join(
            f"{name} {pure(other.score - self.candidates[chosen].score)}"
            for name, other in self.candidates.items()
            if name != chosen
        )
        return (
            f"Chosen model: {chosen}",
            f"reduced chi-square {pure(self.fit.reduced_chi_square)}, where 1 is pure noise",
            f"an information criterion (BIC) is worse by: {worse or 'nothing else was tried'}",
        )

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a model: parameters, reduced chi-square, score."""
        rows = (
            {
                "model": name,
                "held": one.held,
                "parameters": one.fit.model.size,
                "reduced_chi_square": one.fit.reduced_chi_square,
                "score": one.score,
            }
            for name, one in self.candidates.items()
        )
        return data_frame(rows, "model")


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
    measured: bool = True,
) -> Choice:
    """Fit the rigid, the free and the grasped model; choose by an information criterion.

    Where no device that nobody holds explains it, a chain of three masses is fitted, too.

    Parameters
    ----------
    etfe : Etfe
    device : Device, optional
    delay_s, delay_sd_s : float, optional
        The loop delay and its standard deviation, where they are known.
    prior : mapping, optional
        The user's own priors; each candidate takes those that it has a parameter for.
    held : bool, optional
        Whether somebody held the device, where the study says so: then it is not a question.
    seed : int
    measured : bool
        Whether `etfe` is as it was measured: where something else than a command and a position was
        sensed each candidate is fitted to what it makes of that.

    Returns
    -------
    Choice

    Raises
    ------
    InputError
        For a prior of what no candidate has for a parameter.
    """
    refuse_unknown(prior or {}, CANDIDATES)
    fits: dict[str, Fit] = {}
    etfes: dict[str, Etfe] = {}

    def fit_to(name: str, shorter: Fit | None = None, *, most_sets: int) -> None:
        model = build_model(name, device, delay_s, delay_sd_s, etfe.period_s)
        if etfe.of_measured_force:
            model = with_force_sensor(model)
        own = {key: value for key, value in (prior or {}).items() if key in model.names}

        def fitting(response: Etfe, start: Floats | None = None) -> Fit:
            return least_squares(model.with_prior(own), response, seed, start, shorter, most_sets)

        # What the best so far makes of the measurement is near what this one will.
        best = min(fits, key=lambda other: fits[other].reduced_chi_square, default=None)
        first = etfes[best] if best else etfe
        found = fitted_to_the_loop(fitting, etfe, first) if measured else (fitting(etfe), etfe)
        fits[name], etfes[name] = found

    names = {None: ("rigid", "free", "grasped"), True: ("grasped",), False: ("rigid", "free")}
    for name in names[held]:
        # Where a simpler one leaves noise, no deeper valley of a richer one would be chosen.  The
        # direct method takes what a fit leaves for the noise, and of held devices one set of
        # starting points often ends short of the deepest (see `likeliest`).
        reached = any(fit.reduced_chi_square < _NOISE for fit in fits.values())
        many = not reached or (etfe.direct and name == GRASPED.name)
        fit_to(name, most_sets=SETS if many else 1)
    if held is None and etfe.direct:
        fits["free"] = _with_the_hand_for_a_mass(fits["free"], fits["grasped"], etfes["free"])
    one_mass = ONE_IN_A_HAND.name
    if held is None and device is None and _may_be_one_mass(fits):
        fit_to(one_mass, most_sets=1)
    best, candidates, noise = _compared(fits)
    # Where two masses that nobody holds explain it, a third has nothing to explain.
    if held is None and (fits[best].misfits or candidates[best].held):
        # Where a hand explains it, the chain can begin there, too.
        fit_to(_CHAIN, fits["free"], most_sets=SETS if fits["grasped"].misfits else 1)
        if fits[_CHAIN].misfits:
            fits[_CHAIN] = _from_the_hand(fits[_CHAIN], fits["grasped"], etfes[_CHAIN])
        best, candidates, noise = _compared(fits)
    reason = _reason(best, candidates, noise, held)
    tried = {name: replace(one, etfe=etfes[name]) for name, one in candidates.items()}
    return Choice(fits[best], reason, tried)


def _compared(fits: Mapping[str, Fit]) -> tuple[str, dict[str, ScoredFit], float]:
    """The best, what each scored, and the noise's factor by which they were judged."""
    noise = max(1.0, min(fit.reduced_chi_square for fit in fits.values()))
    candidates = {
        name: ScoredFit(fit, information_criterion(fit, noise), deviance(fit, noise)[1])
        for name, fit in fits.items()
    }
    simpler = candidates.pop(ONE_IN_A_HAND.name, None)
    if simpler is not None and simpler.score < candidates[GRASPED.name].score:
        # Its fit stays: a limit wants to know of a mode that the band does not show.
        candidates[GRASPED.name] = replace(simpler, fit=fits[GRASPED.name], as_one_mass=True)
    return _best(candidates, noise), candidates, noise


def _may_be_one_mass(fits: Mapping[str, Fit]) -> bool:
    """Whether the parameters that one mass in a hand saves could make a grasped device the best."""
    _, candidates, _ = _compared(fits)
    grasped = candidates[GRASPED.name]
    if grasped.fit.misfits:
        return False
    saved = len(GRASPED.names) - len(ONE_IN_A_HAND.names)
    most = saved * float(np.log(2 * len(grasped.fit.residual))) + grasped.from_a_hand
    least = min(one.score for one in candidates.values())
    return grasped.score - least < most + UNDECIDED


def _from_the_hand(chain: Fit, grasped: Fit, etfe: Etfe) -> Fit:
    """The better fit of the chain: as it is, or begun with the hand for a third mass."""
    start = as_three_masses(grasped.model, grasped.theta, chain.model)
    other = least_squares(chain.model, etfe, start=start)
    return min(chain, other, key=lambda fit: fit.reduced_chi_square)


def _with_the_hand_for_a_mass(free: Fit, grasped: Fit, etfe: Etfe) -> Fit:
    """The likelier fit of two masses: as it is, or begun with what was found for three.

    In closed loop no fit says that it misfits: all sets of starting points may end in a valley that
    is far below one that a hand leads to.
    """
    if grasped.log_likelihood < free.log_likelihood + UNDECIDED:
        return free
    starts = as_two_masses(grasped.model, grasped.theta, free.model)
    begun = (continued(replace(free, theta=theta, alike=theta[None]), etfe) for theta in starts)
    best = max(begun, key=lambda fit: fit.log_likelihood)
    return best if best.log_likelihood > free.log_likelihood + UNDECIDED else free


def _best(candidates: Mapping[str, ScoredFit], noise: float) -> str:
    """The simplest model that no richer one beats.

    Where no candidate reaches the noise, more parameters always help a little, by standing in for
    something else; then a richer model must also halve the squared residual.
    """
    ordered = sorted(candidates, key=lambda name: candidates[name].fit.model.size)
    best = ordered[0]
    material = 2.0  # a richer model that misfits too must cut the squared residual by this factor
    for name in ordered[1:]:
        better = candidates[name].score < candidates[best].score
        gain = candidates[best].fit.reduced_chi_square / candidates[name].fit.reduced_chi_square
        if better and (noise < MISFIT or gain > material):
            best = name
    return best


def _reason(best: str, candidates: Mapping[str, ScoredFit], noise: float, held: bool | None) -> str:
    chosen = candidates[best].fit
    who = {None: "", True: "Somebody holds it, as was said. "}
    said = who.get(held, "Nobody holds it, as was said. ")
    text = (
        f"{said}Best by itself: {best} ({_WORDS[best]}, {chosen.model.size} parameters)"
        f"{_left(chosen, ', reduced chi-square ')}."
    )
    for name, other in candidates.items():
        if name == best:
            continue
        behind = other.score - candidates[best].score
        text += (
            f" {name.capitalize()} ({other.fit.model.size} parameters) has"
            f"{_left(other.fit, ' ', ', and')} an information criterion (BIC) "
            f"{_plain(abs(behind))} {'worse' if behind > 0 else 'better'}."
        )
    if any(one.as_one_mass for one in candidates.values()):
        text += " Grasped counts as one mass in a hand (7 parameters) here: no transmission shows."
    if noise >= MISFIT:
        text += (
            f" No candidate reaches the noise: the criterion takes {_plain(noise)} times its "
            "variance, and a richer model must also halve the squared residual, or it only stands "
            "in for what is missing."
        )
    return text


def _left(fit: Fit, before: str, after: str = "") -> str:
    """What a fit leaves over the noise; nothing where that is the noise itself."""
    known = fit.windows.noise is None
    return f"{before}{_plain(fit.reduced_chi_square)}{after}" if known else ""


def _plain(value: float) -> str:
    """Three digits without powers of ten."""
    return f"{float(f'{value:.3g}'):,.10g}"
