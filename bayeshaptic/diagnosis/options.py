"""How a measurement is analysed: the options of `analyse`, of `close_loop` and of studies."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from bayeshaptic.devices import Device, load_device
from bayeshaptic.errors import InputError
from bayeshaptic.models import Model, Prior
from bayeshaptic.numerics.spending import BUDGET_S
from bayeshaptic.recordings.read import read_measurement
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Progress


@dataclass(frozen=True)
class Options:
    """How a measurement is analysed.

    Attributes
    ----------
    device : str, Path, Device or None
        By default the model's, if it has one.
    delay_s, delay_sd_s : float or None
        Loop delay and its standard deviation, s; by default the device's, else free.
    band_hz : (float, float) or None
        Lowest and highest frequency used; by default chosen from the data.
    prior : mapping
        Your own priors by parameter name.
    held : bool or None
        Whether somebody held the device; unknown by default.
    lever_m : float or None
        From the axis to the tip; by default the device's.
    ess : float or None
        Effective draws of every parameter; by default what the limit wants
        (`bayeshaptic.diagnosis.limit_known`).
    seed : int
    budget_s : float
        What the search for effects may cost, in nominal seconds: evaluations are counted, so that
        the verdict is the same on every machine (`bayeshaptic.numerics.spending`).
    progress : callable or None
        Called with the share done, 0 to 1, and a word about it.
    """

    device: str | Path | Device | None = None
    delay_s: float | None = None
    delay_sd_s: float | None = None
    band_hz: tuple[float, float] | None = None
    prior: Mapping[str, Prior] = field(default_factory=dict)
    held: bool | None = None
    lever_m: float | None = None
    ess: float | None = None
    seed: int = 0
    budget_s: float = BUDGET_S
    progress: Progress | None = field(default=None, compare=False)

    def with_changes(self, changes: Mapping[str, Any]) -> Options:
        """The same with some of them changed.

        Raises
        ------
        InputError
            Where there is no such option; the message names the nearest one.
        """
        known = [each.name for each in fields(self)]
        for name in changes:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}."
                raise InputError(f"there is no option {name!r}; {hint}")
        given = dict(changes)
        if given.get("prior", {}) is None:
            given["prior"] = {}
        return replace(self, **given)

    def report(self, share: float, word: str) -> None:
        """Tell whoever waits."""
        if self.progress is not None:
            self.progress(share, word)

    def within(self, begin: float, end: float) -> Options:
        """The same for one stage, whose progress goes from `begin` to `end` of the whole."""
        whole = self.report
        return replace(
            self, progress=lambda share, word: whole(begin + (end - begin) * share, word)
        )

    def device_of(self, model: str | Model) -> Device | None:
        """The device, loaded; by default that of `model`."""
        if isinstance(self.device, str | Path):
            return load_device(self.device)
        if self.device is None and isinstance(model, Model):
            return model.device
        return self.device


def measurement_of(
    measurement: Recording | Etfe | str | Path, model: str | Model, options: Options
) -> Recording | Etfe:
    """The measurement, read where a path was given.

    Raises
    ------
    InputError
        Where it is none, or cannot be read.
    """
    if isinstance(model, Recording | Etfe):
        raise InputError("the measurement comes first: close_loop(recording, model).")
    if isinstance(measurement, str | Path):
        device = options.device_of(model)
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
