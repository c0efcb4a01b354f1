"""The likelihood of published relay measurements, for any linear system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import log_ndtr, logsumexp

from bayeshaptic.models import LinearSystem
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
POINTS = 3  # places inside a bin of the power spectral density
EDGE_DEG = 0.5  # how sharply the range of a sampled relay's phase ends
EXACT_DEG = 1.0  # sd of the phase where the relay is taken at its word


@dataclass(frozen=True)
class RelayData:
    """Relay measurements of one device: gain margin and frequency, one a trial or user.

    Attributes
    ----------
    gain_db, frequency_hz : ndarray, shape (n,)
    bin_hz : float
        The frequency lies anywhere within +-bin_hz/2 of what was printed.
    gain_sd_db : float
        Error of one gain.
    sampled : bool
        True: the relay switches at samples, so the phase at the oscillation is anywhere within
        180 f T degrees of -180.  False: it oscillates at the crossing itself.
    """

    gain_db: Floats
    frequency_hz: Floats
    bin_hz: float
    gain_sd_db: float
    sampled: bool = True

    def log_likelihood(self, system: LinearSystem, shift_db: ArrayLike = 0.0) -> Floats:
        """Log density of gains and frequencies for each of B systems, shape (..., B, n).

        `shift_db`, shape (...), is added to every predicted gain.

        The gain is that of the response at the frequency; the frequency is the one where the phase
        is what the relay made of it, so its density is that of the phase times d phase/d f.
        """
        inside = (np.arange(POINTS) + 0.5) / POINTS - 0.5
        frequency = self.frequency_hz[:, None] + self.bin_hz * inside
        response = system.sampled_response(frequency.ravel(), PERIOD_S)
        response = response.reshape(-1, *frequency.shape)
        gain = -20 * np.log10(np.abs(response))
        shift = np.asarray(shift_db, float)[..., None, None, None]
        off = (gain + shift - self.gain_db[:, None]) / self.gain_sd_db
        log_gain = -0.5 * off**2 - np.log(self.gain_sd_db * np.sqrt(2 * np.pi))
        phase = np.degrees(np.angle(-response))
        turn = np.diff(np.unwrap(np.angle(-response), axis=2), axis=2).mean(axis=2, keepdims=True)
        slope = np.abs(np.degrees(turn)) / (self.bin_hz / POINTS)
        with np.errstate(divide="ignore"):
            density = log_gain + self._log_phase(phase, frequency) + np.log(slope)
        return np.asarray(logsumexp(density, axis=-1) - np.log(POINTS))

    def _log_phase(self, phase_deg: Floats, frequency_hz: Floats) -> Floats:
        if not self.sampled:
            return -0.5 * (phase_deg / EXACT_DEG) ** 2 - np.log(EXACT_DEG * np.sqrt(2 * np.pi))
        bound = 180 * frequency_hz * PERIOD_S
        # A box with soft edges; log_ndtr keeps its slope far outside, where draws must find back.
        return log_ndtr((bound - np.abs(phase_deg)) / EDGE_DEG) - np.log(2 * bound)
