"""A relay measurement beside a model: which crossing it settled on, and whether they agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.models.model import Model
from bayeshaptic.stability.binding import binding_kinds, group_crossings
from bayeshaptic.stability.crossings import find_crossings
from bayeshaptic.stability.relay.measurement import RelayMeasurement


@dataclass(frozen=True)
class RelayCheck:
    """What a model says about a relay experiment.

    Attributes
    ----------
    critical_stiffness, binding_hz : float
        K_CR of the model, and the frequency that binds.
    settled_on : str
        The crossing nearest in frequency to the oscillation, for example "rigid body at 8.69 Hz".
    settled_hz, settled_stiffness : float
        Of that crossing; the stiffness is the critical one where it is the one that binds.
    binds : bool
        Whether it is the one that binds.
    predicted : float
        The model's 1/abs(G) at the frequency of the oscillation: what the relay should measure.
    difference_db : float
        Measured minus predicted gain margin, both at the frequency of the oscillation.
    critical_estimate : float
        The stiffness of the crossing that it settled on, times measured over predicted: the
        measurement carried to the crossing with the model's shape.
    """

    critical_stiffness: float
    binding_hz: float
    settled_on: str
    settled_hz: float
    settled_stiffness: float
    binds: bool
    predicted: float
    difference_db: float
    critical_estimate: float


def check_relay(measured: RelayMeasurement, model: Model) -> RelayCheck:
    """Compare a relay measurement with a model at its own values.

    Parameters
    ----------
    measured : RelayMeasurement
    model : Model

    Returns
    -------
    RelayCheck

    Raises
    ------
    InputError
        If the model has no period or no crossing, or its stiffness another unit.
    """
    if model.stiffness_unit != measured.unit:
        raise InputError(
            f"the relay measured a stiffness in {measured.unit}, the model's is in "
            f"{model.stiffness_unit}; give the device that was recorded"
        )
    if model.period_s is None:
        raise InputError("the model has no sampling period: give period_s, or a device.")
    vector = np.atleast_2d(np.asarray(model.values, float))
    system = model.system(vector)
    found = find_crossings(system, model.period_s)
    frequency, stiffness = found.frequency_hz[0], found.stiffness[0]
    if np.isnan(stiffness[0]):
        raise InputError("the model's phase never reaches -180 degrees: nothing to compare with")
    with np.errstate(divide="ignore"):
        nearest = int(np.nanargmin(np.abs(np.log(frequency / measured.frequency_hz))))
    kind = binding_kinds(system, frequency[[nearest]], model.period_s)
    label = group_crossings(kind, frequency[[nearest]])[0][0].label
    response = model.response(vector[0], np.array([measured.frequency_hz]))[0]
    predicted = float(1 / abs(response))
    ratio = measured.gain_margin / predicted
    return RelayCheck(
        float(stiffness[0]),
        float(frequency[0]),
        label,
        float(frequency[nearest]),
        float(stiffness[nearest]),
        nearest == 0,
        predicted,
        float(20 * np.log10(ratio)),
        float(stiffness[nearest] * ratio),
    )
