"""Whether units are in doubt, asked in closed loop of a fit that feedback does not bias.

The measured response of a loop is biased towards what its controller does, and says nothing of
units.  The same questions that are asked of a measured response at the door are asked here of the
fitted one, or of the motion that was followed.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.devices import Device
from bayeshaptic.errors import Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.checks.against_device import against_response
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.rough_response import RoughResponse, rough_response


def with_units_of(
    fit: Fit, recording: Recording | None, device: Device | None, notices: tuple[Notice, ...]
) -> tuple[Notice, ...]:
    """`notices` with what the response of a fit says of units where the force has power.

    Parameters
    ----------
    fit : Fit
        That feedback does not bias.
    recording : Recording or None
    device : Device or None
    notices : tuple of Notice

    Returns
    -------
    tuple of Notice
    """
    if recording is None:
        return notices
    frequency_hz = rough_response(recording).frequency_hz
    response = fit.model.response(fit.theta, frequency_hz)
    clear = RoughResponse(frequency_hz, response, np.ones_like(frequency_hz))
    return against_response(notices, recording, device, clear)
