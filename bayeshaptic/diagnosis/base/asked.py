"""What a caller asked for (device, base model, measurement), by name, by path or as an object."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bayeshaptic.arguments import instance
from bayeshaptic.devices import Device, load_device
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, shown
from bayeshaptic.inference.choose import CANDIDATES
from bayeshaptic.models import Model
from bayeshaptic.models.prior_table import refuse_unknown
from bayeshaptic.models.structures import chain, structure_named
from bayeshaptic.recordings.measurement import read_measurement
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe


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
        Where they contradict each other, or a prior is of what none of the models has.
    """
    if options.modes is None:
        if model == "auto":
            refuse_unknown(options.prior, CANDIDATES)
        elif options.held is not None and options.held != has_a_hand(model):
            said, who = ("yes", "nobody") if options.held else ("no", "somebody")
            raise InputError(
                f"held is {said}, and the model is {shown(model)}, of a device that {who} holds; "
                "leave one of them out"
            )
        return model
    held = model == "grasped" if options.held is None else options.held
    if model not in ("auto", "grasped" if held else "free"):
        who = "somebody" if held else "nobody"
        raise InputError(
            f"modes is {options.modes}, for a device that {who} holds, and the model is "
            f"{shown(model)}; leave one of them out"
        )
    return chain(options.modes, held).name


def has_a_hand(model: str | Model) -> bool:
    """Whether somebody holds the device of a base model."""
    return model.held if isinstance(model, Model) else structure_named(model).held


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
