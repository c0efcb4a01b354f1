"""What is analysed, and of which device: read and loaded where it was named only."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bayeshaptic.arguments import instance
from bayeshaptic.devices import Device, load_device
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.models import Model
from bayeshaptic.recordings.read import read_measurement
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe


def device_of(options: Options, model: str | Model) -> Device | None:
    """The device, loaded; by default that of `model`."""
    if isinstance(options.device, str | Path):
        return load_device(options.device)
    if options.device is None and isinstance(model, Model):
        return model.device
    return options.device


def measurement_of(measurement: Any, model: Any, options: Options) -> Recording | Etfe:
    """The measurement, read where a path was given.

    Raises
    ------
    InputError
        Where it is none, or cannot be read, or the model is none.
    """
    if isinstance(model, Recording | Etfe):
        raise InputError("the measurement comes first: close_loop(recording, model).")
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
