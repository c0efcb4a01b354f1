"""Whether a value of the device file is what keeps a model from explaining the recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.models.build import DEVICE_LOG_SD
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.response.etfe import Etfe

# Standard deviations of the prior around a value of the file, 1 in 10,000: a factor of seven.  Ten
# of eleven masses and springs in another unit are beyond, and none of 51 strangers' right files.
_FAR = 3.89
_TOLD = ("m", "m1", "m2", "kc")  # masses and springs of the device: dampers are hardly seen


def file_in_doubt(
    etfe: Etfe, fits: Mapping[str, Fit], device: Device | None, options: Options
) -> tuple[Notice, ...]:
    """A warning where a model leaves noise without the file's values, and none does with them.

    The prior of a value that is wrong by a thousand lies so far away that fits end in between,
    where nothing explains the recording; effects are then found that make up for it.

    Parameters
    ----------
    etfe : Etfe
    fits : mapping
        By the names of their models.
    device : Device or None
    options : Options
    """
    if device is None:
        return ()
    tried = [fits[name] for name in device.parameters if name in fits]
    if any(not fit.misfits for fit in tried):  # the others' values are of a device held otherwise
        return ()
    for name, given in device.parameters.items():
        if name not in fits or not fits[name].misfits:
            continue
        bare = replace(device, parameters={})
        model = build_model(name, bare, options.delay_s, options.delay_sd_s, etfe.period_s)
        own = {key: prior for key, prior in options.prior.items() if key in model.names}
        alone = least_squares(model.with_prior(own), etfe, options.seed)
        if alone.misfits:
            continue
        found = dict(zip(alone.model.names, alone.theta.tolist(), strict=True))
        far = {
            key: abs(np.log(found[key] / given[key])) / DEVICE_LOG_SD
            for key in _TOLD
            if given.get(key, 0.0) > 0 and found.get(key, 0.0) > 0 and key not in own
        }
        worst = max(far, key=lambda key: far[key], default=None)
        if worst is None or far[worst] < _FAR:
            continue
        kind = "stiffness" if worst == "kc" else "mass"
        unit = unit_of(kind, alone.model.force_unit, alone.model.position_unit)
        text = (
            f"With the values of {device.name}'s file the {name} model does not explain the "
            f"recording, and without them it does: {worst} is {quantity(given[worst], unit)} in "
            f"the file and would be {quantity(found[worst], unit)}. Correct the file, and make the "
            "report again."
        )
        return (Notice("warning", "device", text),)
    return ()
