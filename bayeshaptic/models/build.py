"""Building the rigid, free and grasped models: from a device file, or for an unknown device."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from bayeshaptic.arguments import at_the_door
from bayeshaptic.devices import Device
from bayeshaptic.errors import InputError
from bayeshaptic.models.model import Model
from bayeshaptic.models.parameter import Parameter, before_delay
from bayeshaptic.models.prior import HalfNormal, LogNormal, Normal, Prior
from bayeshaptic.models.prior_of_zero import NearZero
from bayeshaptic.models.structures import (
    FREE,
    GRASPED,
    GROUND_DAMPERS,
    HAND,
    QUANTITIES,
    RIGID,
    Structure,
    chain as chain_of_masses,
    structure_named,
)

# How well a device file is believed, as log standard deviations: configurations, assembly and
# above all people differ.
DEVICE_LOG_SD = 0.5
HAND_LOG_SD = 0.7
# A damper to the ground may be zero: half-normal, at this multiple of the file's total.
DAMPER_SCALE = 2.0
# One that the file gives as zero was not seen: it may be as small as this share of that.
DAMPER_FLOOR = 1e-6
# One that a file gives as less than this share of the total is there, but may be too small to be
# seen: between a half-normal, which is flat next to zero, and that.
SMALL_DAMPER, SMALL_DAMPER_RISE = 0.1, 0.5
# A free delay lies within a few periods.
FREE_DELAY_PERIODS = 2.0
# Strain gauges' amplifiers let pass 100 Hz to some kHz.
FORCE_LAG_S = 1e-3


@at_the_door
def rigid(
    device: str | Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    period_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
) -> Model:
    """One mass and one damper, G of the paper's (1).  For the parameters see `grasped`."""
    return _build(RIGID, device, delay_s, delay_sd_s, period_s, prior)


@at_the_door
def free(
    device: str | Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    period_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
) -> Model:
    """Two masses and a transmission, G1 of the paper's (3).  For the parameters see `grasped`."""
    return _build(FREE, device, delay_s, delay_sd_s, period_s, prior)


@at_the_door
def chain(
    modes: int,
    device: str | Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    period_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
    held: bool = False,
) -> Model:
    """Masses in a row with so many vibration modes, which nobody holds, or a user by the last.

    Parameters
    ----------
    modes : int
        0 is `rigid`, 1 is `free`; N has N + 1 masses: beside those of `free` m3, c3, k3, b3 and so
        on, the mass, what joins it to the one before, and its damper to the ground.  Held, 1 is
        `grasped`.
    device, delay_s, delay_sd_s, period_s, prior
        See `grasped`.  A device file gives the parameters of two masses at most; the priors of a
        longer chain come from the data at the first fit.
    held : bool
        Whether somebody holds it.

    Returns
    -------
    Model
    """
    structure = chain_of_masses(modes, held)
    return _build(structure, device, delay_s, delay_sd_s, period_s, prior)


@at_the_door
def grasped(
    device: str | Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    period_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
) -> Model:
    """A user holds the device, H1 of the paper's (11): 11 parameters and the delay.

    Parameters
    ----------
    device : str or Device, optional
        Name of a device file, path to one, or a loaded one: gives values, priors around them,
        period and delay.  Without it priors come from the data at the first fit.
    delay_s : float, optional
        Loop delay in seconds.  By default the device's; without a device it is free.
    delay_sd_s : float, optional
        Its standard deviation in seconds: 0 is a known delay, infinity a free one.
    period_s : float, optional
        Sampling period in seconds; by default the device's, else the recording's.
    prior : mapping from name to Prior, optional
        Your own priors; they replace those of the device.

    Returns
    -------
    Model

    Raises
    ------
    InputError
        If the device is unknown, has no values for this model, or a number is out of range.
    """
    return _build(GRASPED, device, delay_s, delay_sd_s, period_s, prior)


def build_model(
    name: str,
    device: str | Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    period_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
) -> Model:
    """The model called `name`: rigid, free, grasped, chain-N; the rest is as in `grasped`."""
    return _build(structure_named(name), device, delay_s, delay_sd_s, period_s, prior)


def device_priors(structure: Structure, values: Mapping[str, float]) -> dict[str, Prior]:
    """Priors around a device file's `values`: log-normal, and half-normal for ground dampers.

    A ground damper that the file gives as zero, or as little beside the others, is `NearZero`. What
    the file does not give has no prior here; it comes from the data.
    """
    known = [name for name in structure.names if name in values]
    damping = sum(values[name] for name in known if name in GROUND_DAMPERS)
    priors: dict[str, Prior] = {}
    for name in known:
        if name in GROUND_DAMPERS and damping > 0:
            priors[name] = _damper_prior(values[name], damping)
        elif values[name] > 0:
            priors[name] = LogNormal(values[name], HAND_LOG_SD if name in HAND else DEVICE_LOG_SD)
        elif name not in GROUND_DAMPERS:  # of those, zeros alone say nothing of the scale
            raise InputError(f"the device file gives {name} = {values[name]}; it must be positive.")
    return priors


def _damper_prior(value: float, total: float) -> Prior:
    scale = DAMPER_SCALE * total
    if value >= SMALL_DAMPER * total:
        return HalfNormal(scale)
    return NearZero(scale, DAMPER_FLOOR * scale, SMALL_DAMPER_RISE if value > 0 else 0.0)


def delay_prior(delay_s: float | None, delay_sd_s: float | None, period_s: float) -> Prior | None:
    """The prior of the loop delay; None where it is known."""
    if delay_s is None or delay_sd_s == float("inf"):
        return HalfNormal(FREE_DELAY_PERIODS * period_s)
    return Normal(delay_s, delay_sd_s, low=0.0) if delay_sd_s else None


def with_unknown_delay(model: Model) -> Model:
    """A model, with its sampling period, whose loop delay is inferred, whatever was known of it."""
    assert model.period_s is not None
    belief = delay_prior(None, None, model.period_s)
    delay = Parameter("delay_s", *QUANTITIES["delay_s"], prior=belief)
    others = tuple(p for p in model.parameters if p.name != "delay_s")
    fixed = {name: value for name, value in model.fixed.items() if name != "delay_s"}
    return replace(model, parameters=(*others, delay), fixed=fixed)


def with_force_sensor(model: Model) -> Model:
    """A model beside a measured force, whose sensor may follow it with a lag of first order.

    What lags there is missing in the response, which then leads as if a damper were at the motor
    in the place of its mass: of 22 simulated recordings with a sensor of 100 to 1000 Hz seven had a
    stiffness while the lag was no parameter, 1.26 to 240 times the limit.  A delay that nobody told
    is none: it is before what the sensor sees, and beside a lag it would hide there.

    Parameters
    ----------
    model : Model
    """
    if "delay_s" in model.names and "delay_s" not in model.reference:
        model = model.with_known({"delay_s": 0.0})
    belief = HalfNormal(FORCE_LAG_S)
    lag = Parameter("force_lag_s", *QUANTITIES["force_lag_s"], prior=belief)
    reference = model.reference and {**model.reference, "force_lag_s": 0.1 * FORCE_LAG_S}
    return replace(model, parameters=before_delay(model.parameters, (lag,)), reference=reference)


def _build(
    structure: Structure,
    device: str | Device | None,
    delay_s: float | None,
    delay_sd_s: float | None,
    period_s: float | None,
    prior: Mapping[str, Prior] | None,
) -> Model:
    _check_numbers(delay_s, delay_sd_s, period_s)
    if isinstance(device, str):
        from bayeshaptic.devices import load_device

        device = load_device(device)
    parameters = [Parameter(name, *QUANTITIES[name]) for name in structure.names]
    reference: dict[str, float] = {}
    if device is not None:
        reference = dict(_device_values(device, structure))
        if reference:
            priors = device_priors(structure, reference)
            parameters = [replace(p, prior=priors.get(p.name)) for p in parameters]
        if delay_s is None:
            delay_s = device.delay_s
            delay_sd_s = device.delay_sd_s if delay_sd_s is None else delay_sd_s
        period_s = device.period_s if period_s is None else period_s
    fixed: dict[str, float] = {}
    if delay_s is not None and not delay_sd_s:
        fixed["delay_s"] = delay_s
    else:
        belief = delay_prior(delay_s, delay_sd_s, period_s) if period_s else None
        parameters.append(Parameter("delay_s", *QUANTITIES["delay_s"], prior=belief))
        if delay_s is not None:
            reference["delay_s"] = delay_s
    rotational = device is not None and device.kind == "rotational"
    model = Model(
        structure,
        tuple(parameters),
        fixed,
        period_s,
        reference,
        force_unit="Nm" if rotational else "N",
        position_unit="rad" if rotational else "m",
        device=device,
    )
    return model.with_prior(prior) if prior else model


def _device_values(device: Device, structure: Structure) -> Mapping[str, float]:
    """The device file's values for `structure`; a rigid one is the sum of the free one's parts."""
    values = device.parameters.get(structure.name, {})
    if not values and structure is RIGID and "free" in device.parameters:
        parts = device.parameters["free"]
        sums = {"m": ("m1", "m2"), "b": ("b1", "b2")}
        values = {
            name: sum(parts[part] for part in of)
            for name, of in sums.items()
            if all(part in parts for part in of)
        }
    return {name: values[name] for name in structure.names if name in values}


def _check_numbers(delay_s: float | None, delay_sd_s: float | None, period_s: float | None) -> None:
    for name, value in (("delay_s", delay_s), ("delay_sd_s", delay_sd_s)):
        if value is not None and not value >= 0:
            raise InputError(f"{name} is {value} s; give a number of seconds, zero or more.")
    if period_s is not None and not 0 < period_s < 10:
        raise InputError(
            f"period_s is {period_s} s; give the sampling period in seconds, e.g. 1e-3."
        )
