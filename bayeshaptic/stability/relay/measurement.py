"""What a relay experiment says."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.shown import Shown


@dataclass(frozen=True, repr=False)
class RelayMeasurement(Shown):
    """What a relay experiment says.

    Attributes
    ----------
    frequency_hz, frequency_sd_hz : float
        Of the oscillation: centre of its line in the force's averaged power spectral density. The
        sd is a jackknife's, and at least that of a bin of 1/(length of a segment).
    gain_margin, gain_margin_sd : float
        abs(U/Y) there, in `unit`: the stiffness that the relay measured.
    phase_deg : float
        Phase of the response there, from -180 degrees; positive: it has not come so far yet.
    phase_bound_deg : float
        How far a relay that switches at samples may be off, 180 f T.
    critical_stiffness, critical_stiffness_sd : float or None
        U/Y followed to a phase of -180 degrees, where the recording allows that.
    crossing_hz : float or None
        The frequency of it.
    unit : str
    steady_s : tuple of float
        Begin and end of the steady part that was used.
    share : float
        The oscillation's share of the motion's variance, above half its frequency.
    set_point : float
        Middle of the oscillation: the median of the position; where the set point changes, half-way
        between the places of the switches up and down.
    notices : tuple of Notice
    """

    frequency_hz: float
    frequency_sd_hz: float
    gain_margin: float
    gain_margin_sd: float
    phase_deg: float
    phase_bound_deg: float
    critical_stiffness: float | None
    critical_stiffness_sd: float | None
    crossing_hz: float | None
    unit: str
    steady_s: tuple[float, float]
    share: float
    set_point: float
    notices: tuple[Notice, ...] = ()

    def _lines(self) -> tuple[str, ...]:
        limit = "no crossing can be read"
        if self.critical_stiffness is not None:
            limit = (
                f"critical stiffness {quantity(self.critical_stiffness, self.unit, digits=4)}, "
                f"± {self.critical_sd_db:.2f} dB, at {self.crossing_hz:.2f} Hz"
            )
        return (
            "Relay experiment: oscillates at "
            f"{self.frequency_hz:.2f} ± {self.frequency_sd_hz:.2f} Hz",
            f"gain margin {quantity(self.gain_margin, self.unit, digits=4)}, "
            f"± {self.gain_margin_sd_db:.2f} dB, at {self.phase_deg:+.1f} degrees from -180",
            f"{limit}; {self.steady_s[1] - self.steady_s[0]:.1f} s of steady oscillation",
        )

    @property
    def gain_margin_db(self) -> float:
        """20 log10 of the number in `unit`."""
        return float(20 * np.log10(self.gain_margin))

    @property
    def gain_margin_sd_db(self) -> float:
        """Standard deviation of the gain margin in decibels, to first order."""
        return relative_db(self.gain_margin_sd / self.gain_margin)

    @property
    def critical_db(self) -> float | None:
        """The critical stiffness in decibels, None without one."""
        found = self.critical_stiffness
        return None if found is None else float(20 * np.log10(found))

    @property
    def critical_sd_db(self) -> float | None:
        """Standard deviation of the critical stiffness in decibels; None without one."""
        if self.critical_stiffness is None or self.critical_stiffness_sd is None:
            return None
        return relative_db(self.critical_stiffness_sd / self.critical_stiffness)


def relative_db(relative: float) -> float:
    """A small relative error in decibels, to first order: 20 / ln(10) of it."""
    return float(20 / np.log(10) * relative)
