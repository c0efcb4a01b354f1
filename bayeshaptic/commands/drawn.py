"""A device drawn from a saved posterior, or from its priors: for predictive recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bayeshaptic.devices.device import Device, kind_of
from bayeshaptic.errors import InputError
from bayeshaptic.inference.load import load_posterior
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models.prior import draw
from bayeshaptic.types import Floats


def drawn_device(path: Path, seed: int, from_prior: bool) -> tuple[Device, str]:
    """A device with one draw's parameters, and the mechanism that they are of.

    Parameters
    ----------
    path : Path
        ``posterior.nc`` of a report.
    seed : int
        Which draw: the same seed gives the same one.
    from_prior : bool
        From the priors of the model instead: a prior predictive recording.

    Raises
    ------
    InputError
        Where the file holds no posterior, or its model has effects: the bench has its own.
    """
    posterior = load_posterior(path)
    model = posterior.model
    if model.effects:
        names = ", ".join(effect.name for effect in model.effects)
        raise InputError(
            f"{path}: a posterior with effects ({names}), which the bench has of its own; simulate "
            "the device's file, and add them with --effect"
        )
    theta = _drawn(posterior, np.random.default_rng(seed), from_prior)
    values = dict(model.fixed) | dict(zip(model.names, map(float, theta), strict=True))
    delay_s = values.pop("delay_s", 0.0)
    known = model.device
    device = Device(
        name=known.name if known else path.stem,
        kind=kind_of(model.position_unit),
        period_s=model.period_s,
        delay_s=delay_s,
        encoder_resolution=known.encoder_resolution if known else None,
        band_hz=known.band_hz if known else None,
        parameters={model.name: values},
    )
    return device, model.name


def _drawn(posterior: Posterior, rng: np.random.Generator, from_prior: bool) -> Floats:
    if not from_prior:
        return posterior.draws[rng.integers(len(posterior.draws))]
    model = posterior.model
    return np.array([draw(model.prior(name), rng, 1)[0] for name in model.names])
