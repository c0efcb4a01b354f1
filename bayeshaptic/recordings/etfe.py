"""The ETFE: the empirical transfer function estimate of a recording, with an honest variance."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import Notice
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.spectra import PeriodicSpectra, RandomSpectra, Spectra, TableSpectra

__all__ = ["Etfe", "PeriodicSpectra", "RandomSpectra", "TableSpectra", "estimate_etfe"]


@dataclass(frozen=True)
class Etfe:
    """The measured frequency response from commanded force to position.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
        What a person sees: one point a window (random excitation), an excited line (periodic
        excitation) or a row (table).
    value : complex ndarray, shape (L,)
        Estimated response, position unit over force unit.
    variance : ndarray, shape (L,)
        E|estimate - truth|^2; the real and the imaginary part have half of it each.
    coherence : ndarray, shape (L,)
        Share of the position's power that the force explains, 0..1; nan where it makes no sense.
    period_s : float
        Sampling period in seconds.
    band_hz : (float, float)
        Lowest and highest frequency used.
    force_unit, position_unit : str
    spectra : RandomSpectra or PeriodicSpectra or TableSpectra
        What `compress` needs: the windows can be built from it with any reference.
    recording : Recording or None
        None for a table.
    period_lines : int or None
        Number of excited lines; None when the excitation is not periodic.
    notices : tuple of Notice
    """

    frequency_hz: NDArray[Any]
    value: NDArray[Any]
    variance: NDArray[Any]
    coherence: NDArray[Any]
    period_s: float
    band_hz: tuple[float, float]
    force_unit: str
    position_unit: str
    spectra: Spectra = field(repr=False)
    recording: Recording | None = field(default=None, repr=False)
    period_lines: int | None = None
    notices: tuple[Notice, ...] = ()

    @property
    def lines(self) -> int:
        """Number of DFT lines (or rows of a table) behind the estimate."""
        return self.spectra.lines

    @property
    def relative_sd(self) -> NDArray[Any]:
        """Standard deviation over the magnitude of the estimate, shape (L,)."""
        return np.sqrt(self.variance) / np.abs(self.value)

    @property
    def kind(self) -> str:
        """ "translational" or "rotational", by the unit of the position."""
        return "rotational" if self.position_unit == "rad" else "translational"

    @property
    def stiffness_unit(self) -> str:
        return f"{'N m' if self.force_unit == 'Nm' else self.force_unit}/{self.position_unit}"

    @property
    def gain_db(self) -> NDArray[Any]:
        """20 log10 of the magnitude, dB re position unit over force unit, shape (L,)."""
        return 20 * np.log10(np.abs(self.value))

    @property
    def phase_deg(self) -> NDArray[Any]:
        """Unwrapped phase in degrees, shape (L,)."""
        return np.degrees(np.unwrap(np.angle(self.value)))


def estimate_etfe(
    recording: Recording,
    band_hz: tuple[float, float] | None = None,
    *,
    minimum_lines: int | None = None,
) -> Etfe:
    """Estimate the response from commanded force to position, with its variance.

    Parameters
    ----------
    recording : Recording
    band_hz : (low, high), optional
        Frequencies to use, Hz. By default chosen from the data: where the force has power and
        the response stands out of the noise.
    minimum_lines : int, optional
        DFT lines in the narrowest window of a random excitation.

    Raises
    ------
    InputError
        When the recording is too short, the force has no power, or the band makes no sense.
    """
    raise NotImplementedError
