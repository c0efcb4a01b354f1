"""What an analysis, or the loop, begins with: a measurement checked, a base model fitted."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bayeshaptic.arguments import instance, shown
from bayeshaptic.devices import Device, load_device
from bayeshaptic.diagnosis.of_the_loop import as_of_the_loop, hardly_differ
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.choose import Choice, choose_model
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import Model, build_model
from bayeshaptic.models.structures import chain
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.check import check_recording
from bayeshaptic.recordings.checks.sufficiency import refuse_where_told, told_too_little, too_little
from bayeshaptic.recordings.feedback import has_feedback, told
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.measurement import read_measurement
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.differences import with_differences
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.other_outputs import NO_LOOP, with_loop_delay
from bayeshaptic.recordings.through_reference import through_reference, too_weak, unusable
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.threads import single_threaded

_WIDEST = 0.4  # of the sampling rate: a band's upper end
_MOST_ROUNDS = 8  # fits to what the last one makes of the samples


def device_of(options: Options, model: str | Model) -> Device | None:
    """The device, loaded; by default that of `model`."""
    if isinstance(options.device, str | Path):
        return load_device(options.device)
    if options.device is None and isinstance(model, Model):
        return model.device
    return options.device


def base_model(model: str | Model, options: Options) -> str | Model:
    """The base model that is asked for: `model`, or the chain with the modes of the options.

    Somebody holds that where the model is "grasped", or the options say so.

    Raises
    ------
    InputError
        Where they contradict each other.
    """
    if options.modes is None:
        return model
    held = model == "grasped" if options.held is None else options.held
    if model not in ("auto", "grasped" if held else "free"):
        who = "somebody" if held else "nobody"
        raise InputError(
            f"modes is {options.modes}, for a device that {who} holds, and the model is "
            f"{shown(model)}; leave one of them out"
        )
    return chain(options.modes, held).name


def measurement_of(measurement: Any, model: Any, options: Options) -> Recording | Etfe:
    """The measurement, read where a path was given.

    Raises
    ------
    InputError
        Where it is none, or cannot be read, or the model is none.
    """
    if isinstance(model, Recording | Etfe):
        raise InputError(
            "the measurement comes first, then the model: close_loop(recording, model)."
        )
    instance("model", model, (str, Model), "its name, as in 'auto' or 'free', or a Model")
    if isinstance(measurement, str | Path):
        device = device_of(options, model)
        if device is None:
            return read_measurement(Path(measurement))
        return read_measurement(
            Path(measurement),
            encoder_resolution=device.encoder_resolution,
            kind=device.kind,
            default_period_s=device.period_s,
        )
    if not isinstance(measurement, Recording | Etfe):
        raise InputError(
            f"a measurement is a recording, an ETFE or a path, not {type(measurement).__name__}; "
            "see bayeshaptic.read_recording."
        )
    return measurement


@dataclass
class Clock:
    """How long each stage took."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - began


@dataclass(frozen=True)
class Opened:
    """A measurement that was checked, with its response; attributes are those of `Analysis`.

    `asked` is the name of the base model that was asked for.
    """

    etfe: Etfe
    device: Device | None
    notices: tuple[Notice, ...]
    seconds: dict[str, float]
    lever_m: float | None
    asked: str

    @property
    def one_mass(self) -> bool:
        """Whether the device was declared to be one."""
        return self.asked == "rigid"


@dataclass(frozen=True)
class Begun(Opened):
    """With a base model fitted to it: what an analysis, or the loop, begins with."""

    fit: Fit
    choice: Choice | None


def begin(measurement: Recording | Etfe, model: str | Model, options: Options) -> Begun:
    """Check the measurement, estimate its response, and fit the base model; see `analyse`."""
    return fitted(opened(measurement, model, options), model, options)


@single_threaded
def opened(measurement: Recording | Etfe, model: str | Model, options: Options) -> Opened:
    """Check the measurement, and estimate its response."""
    asked = base_model(model, options)
    name = asked.name if isinstance(asked, Model) else asked
    one_mass = name == "rigid"
    clock = Clock()
    device = device_of(options, asked)
    if isinstance(measurement, Recording):
        measurement = with_differences(measurement)
    measurement, notices = with_delay_of_the_loop(measurement, device, options)
    if isinstance(measurement, Recording):
        with clock.stage("checks"):
            options.report(0.0, "checking the recording")
            whole = unbroken(measurement)
            notices += told(measurement.feedback, check_recording(whole, device))
            if one_mass:  # followed in time instead
                if measurement.reference is not None and has_feedback(notices):
                    notices += (unusable("one mass is followed in time, which needs none"),)
                measurement = replace(measurement, reference=None)
            else:
                measurement, notices = through_reference(measurement, notices)
            if not any(notice.topic == "feedback" for notice in notices):
                notices += too_little(whole)
                if not one_mass:
                    refuse_where_told(whole, notices)
        with clock.stage("frequency response"):
            options.report(0.03, "estimating the frequency response")
            etfe, notices = _response(measurement, options.band_hz, notices)
            notices += _not_looked_for(measurement, notices)
    else:
        etfe = measurement
    lever_m = options.lever_m
    if lever_m is None and device is not None:
        lever_m = device.lever_m
    return Opened(etfe, device, notices + etfe.notices, clock.seconds, lever_m, name)


@single_threaded
def fitted(found: Opened, model: str | Model, options: Options) -> Begun:
    """Fit the base model to what was opened, where the response says enough."""
    refuse_where_told(found.etfe.recording, found.notices)
    clock = Clock(dict(found.seconds))
    with clock.stage("least squares"):
        options.report(0.06, "fitting")
        fit, choice = _fit(found.etfe, base_model(model, options), found.device, options)
        begun = Begun(**{**vars(found), "seconds": clock.seconds}, fit=fit, choice=choice)
        for _ in range(_MOST_ROUNDS):
            etfe = as_of_the_loop(found.etfe, begun.fit)
            if hardly_differ(etfe, begun.etfe):
                break
            begun = refitted(begun, etfe, model, options)
    return begun


def refitted(begun: Begun, etfe: Etfe, model: str | Model, options: Options) -> Begun:
    """With the base model fitted to another estimate of the response."""
    fit, choice = _fit(etfe, base_model(model, options), begun.device, options)
    return replace(begun, etfe=etfe, fit=fit, choice=choice)


def with_delay_of_the_loop(
    measurement: Recording | Etfe, device: Device | None, options: Options
) -> tuple[Recording | Etfe, tuple[Notice, ...]]:
    """The measurement as of the loop: what a sensor of the force, or a hammer, saw has no delay.

    Where the delay is known it is put in; otherwise whoever reads the limit is warned.
    """
    if not any(notice.topic == NO_LOOP for notice in measurement.notices):
        return measurement, ()
    delay_s = options.delay_s
    if delay_s is None and device is not None:
        delay_s = device.delay_s
    if delay_s is None:
        text = (
            "The force was measured behind the loop's delay, and the delay is not known: the limit "
            "is that of a loop without any, and the real one is lower. Give it with --delay-s."
        )
        return measurement, (Notice("warning", NO_LOOP, text),)
    if isinstance(measurement, Recording):
        return with_loop_delay(measurement, delay_s), ()
    return measurement.later(delay_s), ()


def _not_looked_for(recording: Recording, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """What no test looks for in pieces: the motion of one says nothing of how the next began."""
    if not recording.joints or has_feedback(notices) or told_too_little(notices):
        return ()
    text = (
        "In several pieces taken as one neither drift nor faults of samples are looked for, and "
        "dry friction (or any other force that is not linear) in the longest alone; it is not "
        "taken off, and makes the limit too high: report on the longest piece by itself, too."
    )
    return (Notice("warning", "pieces", text),)


def _response(
    recording: Recording, band_hz: tuple[float, float] | None, notices: tuple[Notice, ...]
) -> tuple[Etfe, tuple[Notice, ...]]:
    """The response; one that nothing is read from is for comparison only, in any band."""
    try:
        return estimate_etfe(recording, band_hz), notices
    except InputError as error:
        if recording.reference is not None:
            notices = too_weak(notices, str(error))
        elif not (has_feedback(notices) or told_too_little(notices)) or band_hz is not None:
            raise
    longest = max(piece.duration_s for piece in recording.pieces)
    widest = (1 / longest, _WIDEST / recording.period_s)
    return estimate_etfe(replace(recording, reference=None), widest, fewest_tones=1), notices


def _fit(
    etfe: Etfe,
    model: str | Model,
    device: Device | None,
    options: Options,
) -> tuple[Fit, Choice | None]:
    """The fit of the model that was asked for, or of the chosen one."""
    prior, seed = dict(options.prior), options.seed
    if isinstance(model, Model):
        return least_squares(model.with_prior(prior), etfe, seed=seed), None
    delay = options.delay_s, options.delay_sd_s
    if model == "auto":
        choice = _lower_where_undecided(
            choose_model(etfe, device, *delay, prior, options.held, seed)
        )
        return choice.fit, choice
    built = build_model(model, device, *delay, etfe.period_s, prior)
    return least_squares(built, etfe, seed=seed), None


def _lower_where_undecided(choice: Choice) -> Choice:
    """The choice; where it is open whether somebody holds the device, that with the lower limit."""
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
