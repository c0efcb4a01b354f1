"""What is known of a device before it is measured."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bayeshaptic.quantities import quantity
from bayeshaptic.shown import Shown

KINDS = ("translational", "rotational")

# The parameters of each base model, in the order of the paper's tables; a device file may give
# a value for any of them.
STRUCTURES: dict[str, tuple[str, ...]] = {
    "rigid": ("m", "b"),
    "free": ("m1", "b1", "bc", "kc", "m2", "b2"),
    "grasped": ("m1", "b1", "bc", "kc", "m2", "b2", "bs", "ks", "mh", "bh", "kh"),
}


def kind_of(position_unit: str) -> str:
    """Which of `KINDS` a device is by the unit of its position, "m" or "rad"."""
    return KINDS[position_unit == "rad"]


@dataclass(frozen=True, repr=False)
class Device(Shown):
    """A device's facts, from a device file or from the `[device]` table of a study.

    Attributes
    ----------
    name : str
    kind : {"translational", "rotational"}
        Masses in kg, dampers in N s/m and springs in N/m, or kg m^2, N m s/rad and N m/rad.
    period_s : float or None
        Period of the control loop.
    delay_s, delay_sd_s : float or None
        Loop delay beyond the hold, and its standard deviation. A delay without a standard deviation
        is known exactly; without a delay it is estimated.
    encoder_resolution : float or None
        One count of the motor's encoder, in m or rad.
    lever_m : float or None
        Lever arm from the axis to the tip of a rotational device.
    band_hz : tuple of float or None
        Lowest and highest frequency of the usual excitation.
    parameters : mapping of str to mapping of str to float
        Values by base model ("rigid", "free", "grasped") and parameter name.
    notes : tuple of str
        Sources and remarks for the report.
    """

    name: str
    kind: str
    period_s: float | None = None
    delay_s: float | None = None
    delay_sd_s: float | None = None
    encoder_resolution: float | None = None
    lever_m: float | None = None
    band_hz: tuple[float, float] | None = None
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict, hash=False)
    notes: tuple[str, ...] = ()

    @property
    def position_unit(self) -> str:
        return "rad" if self.kind == "rotational" else "m"

    @property
    def force_unit(self) -> str:
        """Unit of a commanded force with a known force constant."""
        return "Nm" if self.kind == "rotational" else "N"

    def _lines(self) -> tuple[str, ...]:
        def told(value: float | None, unit: str) -> str:
            return "unknown" if value is None else quantity(value, unit)

        return (
            f"Device {self.name}: {self.kind}, parameters of {', '.join(self.parameters)}",
            f"period {told(self.period_s, 's')}, loop delay {told(self.delay_s, 's')}",
            f"encoder count {told(self.encoder_resolution, self.position_unit)}, lever "
            f"{told(self.lever_m, 'm')}",
        )
