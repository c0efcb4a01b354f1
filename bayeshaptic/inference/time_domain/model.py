"""The model of one mass with friction in a loop, with weak priors from the motion itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bayeshaptic.devices import Device
from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.mass_in_loop import MASS
from bayeshaptic.models import LogNormal, MaybeZero, Model, Normal, Parameter, Prior, build_model
from bayeshaptic.models.build import delay_prior
from bayeshaptic.models.prior_of_zero import SPIKE_OF_MOTOR
from bayeshaptic.recordings.recording import Recording


def rigid_with_friction(
    recording: Recording,
    motion: MotionFit,
    device: Device | None = None,
    delay_s: float | None = None,
    delay_sd_s: float | None = None,
    prior: Mapping[str, Prior] | None = None,
) -> Model:
    """Mass, viscous damping, dry friction, constant force and delay.

    Priors are the device's where it has them; else a factor e for the mass, a damper that is felt
    at the recording's bandwidth, friction and constant force as large as the command.  K_CR is
    that of the mass, its damper and the delay.

    Parameters
    ----------
    recording : Recording
    motion : MotionFit
    device : Device, optional
    delay_s, delay_sd_s : float, optional
        As in `bayeshaptic.analyse`.
    prior : mapping, optional
        Your own priors by parameter name; names that the model does not have are left aside.
    """
    period_s = recording.period_s
    base = build_model("rigid", device, delay_s, delay_sd_s, period_s)
    base = replace(
        base, force_unit=recording.force_unit, position_unit=recording.position_unit
    ).with_period(period_s)
    mass, size = float(motion.inside[MASS]), float(np.std(recording.force))
    mass_log_sd = 1.0
    weak: dict[str, Prior] = {
        "m": LogNormal(mass, mass_log_sd),
        "b": MaybeZero(2 * np.pi * motion.bandwidth_hz * mass, weight=SPIKE_OF_MOTOR),
    }
    free = delay_prior(None, None, period_s)
    assert free is not None
    weak["delay_s"] = free
    known = [replace(p, prior=p.prior or weak[p.name]) for p in base.parameters]
    friction = [
        Parameter("coulomb", "force", "dry (Coulomb) friction", MaybeZero(size)),
        Parameter("offset", "force", "constant force against the command", Normal(0.0, size)),
    ]
    late = [p for p in known if p.name == "delay_s"]
    first = [p for p in known if p.name != "delay_s"]
    model = replace(base, parameters=tuple(first + friction + late))
    return model.with_prior({n: p for n, p in (prior or {}).items() if n in model.names})
