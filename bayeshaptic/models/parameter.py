"""A parameter: its name, what it is, its unit and its prior."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from bayeshaptic.errors import InputError
from bayeshaptic.models.prior import Prior

_UNITS = {
    ("N", "m"): {"mass": "kg", "damping": "N s/m", "stiffness": "N/m", "force": "N"},
    ("Nm", "rad"): {
        "mass": "kg m^2",
        "damping": "N m s/rad",
        "stiffness": "N m/rad",
        "force": "N m",
    },
}


def unit_of(dimension: str, force_unit: str, position_unit: str) -> str:
    """The unit of a quantity, for a force in `force_unit` and a position in `position_unit`.

    Parameters
    ----------
    dimension : str
        "mass", "damping", "stiffness", "force", "position", "time", "frequency", "number",
        "velocity", "cubic_stiffness" (force over position cubed), "drag" (force over velocity
        squared), "cubic_damping" (force over velocity cubed), or "damping_growth" (damping over
        position squared).
    force_unit : {"N", "Nm", "A"}
        Without a torque constant a force is in amperes, and so a mass is in A s^2/rad.
    position_unit : {"m", "rad"}
    """
    plain = {"time": "s", "frequency": "Hz", "number": "", "position": position_unit}
    if dimension in plain:
        return plain[dimension]
    known = _UNITS.get((force_unit, position_unit), {})
    if dimension in known:
        return known[dimension]
    force = "N m" if force_unit == "Nm" else force_unit
    return {
        "mass": f"{force} s^2/{position_unit}",
        "damping": f"{force} s/{position_unit}",
        "stiffness": f"{force}/{position_unit}",
        "cubic_stiffness": f"{force}/{position_unit}^3",
        "velocity": f"{position_unit}/s",
        "drag": f"{force} s^2/{position_unit}^2",
        "cubic_damping": f"{force} s^3/{position_unit}^3",
        "damping_growth": f"{force} s/{position_unit}^3",
        "force": force,
    }[dimension]


_NEVER_BELOW_ZERO = ("mass", "damping", "stiffness", "time")


@dataclass(frozen=True)
class Parameter:
    """One number that the data and the prior decide.

    Attributes
    ----------
    name : str
        For example ``"kc"``.
    dimension : str
        What kind of quantity it is; with the units of force and position it gives the unit.
    title : str
        What it is, in words.
    prior : Prior or None
        None where the prior is to be set from the data (a device without a device file).
    """

    name: str
    dimension: str
    title: str
    prior: Prior | None = None

    def __post_init__(self) -> None:
        never_below_zero = self.dimension in _NEVER_BELOW_ZERO
        if self.prior is not None and never_below_zero and not self.prior.support[1] > 0:
            raise InputError(
                f"the prior of {self.name} is {self.prior}; give one with values above 0."
            )

    def known(self, value: float) -> float:
        """A value of it, where it can have that one.

        Raises
        ------
        InputError
            For NaN and infinity, for what is outside its prior's support, and for what no prior
            allows: masses that are not above zero, dampers and springs below it, and delays below
            it, unless this one's prior says how far, as of a delay beyond the declared one.
        """
        low, high = (-math.inf, math.inf) if self.prior is None else self.prior.support
        less = self.dimension == "time" and -math.inf < low
        if self.dimension in _NEVER_BELOW_ZERO and not less:
            low = max(low, 0.0)
        above = value > 0 if self.dimension == "mass" else value >= low
        if not (math.isfinite(value) and above and low <= value <= high):
            can_be = f"{'above 0' if self.dimension == 'mass' and low <= 0 else f'from {low:g} on'}"
            most = f", up to {high:g}" if high < math.inf else ""
            raise InputError(f"{self.name} is {value:g}; a {self.title} can be {can_be}{most}")
        return float(value)


def before_delay(known: Iterable[Parameter], added: Iterable[Parameter]) -> tuple[Parameter, ...]:
    """Parameters with more of them, which come before the delay: it stays the last."""
    return tuple(sorted((*known, *added), key=lambda parameter: parameter.name == "delay_s"))
