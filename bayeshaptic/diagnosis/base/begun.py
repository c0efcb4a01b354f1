"""What an analysis, or the loop, begins with: a measurement with a base model fitted to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.base.alignment import realigned
from bayeshaptic.diagnosis.base.asked import base_model
from bayeshaptic.diagnosis.base.file_in_doubt import file_in_doubt
from bayeshaptic.diagnosis.base.high_passed import perhaps_high_passed
from bayeshaptic.diagnosis.base.opened import Clock, Opened, opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.inference.choose import Choice, choose_model
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.loop_response import fitted_to_the_loop
from bayeshaptic.models import Model, build_model
from bayeshaptic.models.build import with_force_sensor
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.sufficiency import refuse_where_told
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats

_UNHELD = "rigid", "free"


@dataclass(frozen=True)
class Begun(Opened):
    """An `Opened` with a base model fitted to it: what an analysis, or the loop, begins with.

    `measured` is the response as it was measured, `etfe` what the fitted model makes of it.
    """

    measured: Etfe
    fit: Fit
    choice: Choice | None


def begin(measurement: Recording | Etfe, model: str | Model, options: Options) -> Begun:
    """Check the measurement, estimate its response, and fit the base model; see `analyse`."""
    return fitted(opened(measurement, model, options), model, options)


@single_threaded
def fitted(found: Opened, model: str | Model, options: Options) -> Begun:
    """Fit the base model to what was opened, where the response says enough."""
    refuse_where_told(found.etfe.recording, found.notices)
    clock = Clock(dict(found.seconds))
    with clock.stage("least squares"):
        options.report(0.06, "fitting")
        etfe, fit, choice = _fit(found.etfe, base_model(model, options), found.device, options)
        again = realigned(found, fit, model, options, _tried(choice, fit))
        if again is not None:
            return fitted(again, model, options)
        tried = {fit.model.name: fit}
        tried |= {name: one.fit for name, one in choice.candidates.items()} if choice else {}
        doubt = file_in_doubt(etfe, tried, found.device, options)
        doubt = (*doubt, *perhaps_high_passed(fit, etfe, choice, found.etfe.recording))
    notices = (*found.notices, *doubt)
    parts = {**vars(found), "etfe": etfe, "notices": notices, "seconds": clock.seconds}
    return Begun(**parts, measured=found.etfe, fit=fit, choice=choice)


def base_of(begun: Begun, name: str) -> tuple[Etfe, Fit]:
    """The fit of a base model that was tried, and the response that it was fitted to."""
    if begun.choice is None or name == begun.fit.model.name:
        return begun.etfe, begun.fit
    tried = begun.choice.candidates[name]
    return tried.etfe or begun.etfe, tried.fit


def refitted(begun: Begun, etfe: Etfe, model: str | Model, options: Options) -> Begun:
    """`begun` with its base model fitted again, to another estimate of the response."""
    etfe, fit, choice = _fit(etfe, base_model(model, options), begun.device, options, False)
    return replace(begun, etfe=etfe, fit=fit, choice=choice)


def _fit(
    etfe: Etfe,
    model: str | Model,
    device: Device | None,
    options: Options,
    measured: bool = True,
) -> tuple[Etfe, Fit, Choice | None]:
    """The fit of the model that was asked for, or of the chosen one, and what it was fitted to.

    `measured` says whether `etfe` is as it was measured, or what a model made of that.
    """
    prior, seed = dict(options.prior), options.seed
    delay = options.delay_s, options.delay_sd_s
    if model == "auto":
        choice = _lower_where_undecided(
            choose_model(etfe, device, *delay, prior, options.held, seed, measured)
        )
        return choice.candidates[choice.fit.model.name].etfe or etfe, choice.fit, choice
    built = model if isinstance(model, Model) else _built(model, etfe, device, options)
    built = built.with_prior(prior)

    def fitting(response: Etfe, start: Floats | None = None) -> Fit:
        return least_squares(built, response, seed, start)

    fit, etfe = fitted_to_the_loop(fitting, etfe, etfe) if measured else (fitting(etfe), etfe)
    return etfe, fit, None


def simpler(begun: Begun, fit: Fit, options: Options) -> Iterator[Fit]:
    """Fits of base models with fewer parameters than the one in question, simplest first.

    Those that were tried; where a model was asked for, one mass and two that nobody holds; and the
    base model without its effects.

    Parameters
    ----------
    begun : Begun
    fit : Fit
        Of the base model, with effects or without.
    options : Options
    """
    if begun.choice is not None:
        yield from _tried(begun.choice, fit)
    else:
        for name in _UNHELD:
            model = _built(name, begun.etfe, begun.device, options)
            if model.size < begun.fit.model.size:
                yield least_squares(model, begun.etfe, options.seed, most_sets=1)
    if fit.model.effects:
        yield begun.fit


def _built(name: str, etfe: Etfe, device: Device | None, options: Options) -> Model:
    """A base model by its name, with what is known of the delay."""
    built = build_model(name, device, options.delay_s, options.delay_sd_s, etfe.period_s)
    return with_force_sensor(built) if etfe.of_measured_force else built


def _tried(choice: Choice | None, fit: Fit) -> tuple[Fit, ...]:
    """Fits of candidates with fewer parameters, simplest first."""
    fits = [other.fit for other in choice.candidates.values()] if choice else []
    fits = [other for other in fits if other.model.size < fit.model.size]
    return tuple(sorted(fits, key=lambda other: other.model.size))


def _lower_where_undecided(choice: Choice) -> Choice:
    """The choice; where it is open whether somebody holds the device, the lower limit decides."""
    if not choice.undecided:
        return choice
    names = (choice.fit.model.name, *choice.undecided)
    fits = {name: choice.candidates[name].fit for name in names}
    limits = {
        name: float(critical_stiffness(fit.model, fit.theta).value) for name, fit in fits.items()
    }
    lowest = min(names, key=lambda name: limits[name])
    said = ", ".join(
        f"{name} {quantity(limits[name], fits[name].model.stiffness_unit)}" for name in names
    )
    text = (
        f" Whether somebody holds it, this recording does not tell ({' and '.join(names)} explain "
        f"it alike): the one with the lower limit is taken, {lowest} ({said}). Say it with --held."
    )
    return replace(choice, fit=fits[lowest], reason=choice.reason + text)
