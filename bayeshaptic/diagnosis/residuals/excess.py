"""Noise in the driven band beside the noise above it, where the force does nothing."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, RandomSpectra
from bayeshaptic.recordings.response.local_polynomial import leakage_terms
from bayeshaptic.recordings.signals.raw_signals import increment_unit
from bayeshaptic.types import Floats

_LINES, _FEWEST = 60, 5  # lines in a stretch above the band, and stretches that tell a floor
_TOGETHER = 3  # windows whose noise is averaged


def excess_noise_test(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """How far does the noise in the driven band rise above the encoder's?

    The noise of an encoder is the same at all frequencies, and where the force ends nothing else
    is left. What a linear device adds to it is the motion of a hand, at low frequencies; so noise
    that rises inside the band comes of a force that is not linear in the motion, of a device that
    changes, or of a fault of the measurement.  The noise of a sensor of the force moves nothing,
    but is multiplied by the response when that is taken off.  None without frequencies that are not
    driven, or where the motion is too slow for its encoder.
    """
    recording, spectra = etfe.unbroken, etfe.spectra
    if recording is None or not isinstance(spectra, RandomSpectra):
        return ()
    rounded = 0.25  # counts a sample; rounding a slower motion does not make white noise
    if _counts_a_sample(recording) < rounded:
        return ()
    floor = _floor(recording, etfe.band_hz)
    windows = RandomSpectra.windows(spectra, fit.response)  # as measured, nothing discounted
    centre = windows.frequency_hz[:, 1]
    hand_hz, free_hz = 45.0, 20.0  # below it a hand, or a draught, moves the device
    driven = centre > (hand_hz if fit.model.held else free_hz)
    if floor is None or driven.sum() < _TOGETHER:
        return ()
    together = np.ones(_TOGETHER)
    shape = _of_the_sensor(recording, centre[driven])
    scatter = np.convolve(windows.scatter[driven] * shape, together, "valid")
    freedom = np.convolve(windows.lines[driven] - 3, together, "valid")
    least = np.convolve(spectra.floor[driven] * shape, together / _TOGETHER, "valid")
    moved = np.abs(fit.response(centre[driven])) ** 2 * _of_the_force(recording, etfe.band_hz)
    moved = np.convolve(moved * shape, together / _TOGETHER, "valid")
    rise = 10 * np.log10(scatter / freedom / np.maximum(floor + moved, least))
    worst = int(np.argmax(rise))
    where = float(centre[driven][worst + _TOGETHER // 2])
    text = f"around {where:.3g} Hz the noise is {rise[worst]:.1f} dB louder than outside the band"
    return (Test(EXCESS_NOISE, "nonlinear", float(rise[worst]), thresholds.EXCESS_DB, where, text),)


def _counts_a_sample(recording: Recording) -> float:
    """Mean increment in counts; infinite where there are none."""
    unit = max(increment_unit(recording.position) or 0.0, recording.encoder_resolution or 0.0)
    steps = float(np.mean(np.abs(np.diff(recording.position))))
    return steps / unit if unit > 0 else np.inf


def _of_the_sensor(recording: Recording, frequency_hz: NDArray[Any]) -> Floats:
    """What makes power of the position one of what was sensed, whose noise is alike everywhere."""
    if recording.sensed is None:
        return np.ones(len(frequency_hz))
    return recording.sensed.noise(2 * np.pi * frequency_hz * recording.period_s)


def _of_the_force(recording: Recording, band_hz: tuple[float, float]) -> float:
    """Power of a line of a measured force above the band, where it is noise; a command has none."""
    if recording.sensed is None or not recording.sensed.measured_force:
        return 0.0
    force = recording.sensed.force - recording.sensed.force.mean()
    power = np.abs(np.fft.rfft(force * np.hanning(len(force)))) ** 2 / (0.375 * len(force))
    frequency = np.fft.rfftfreq(len(force), recording.period_s)
    above = power[frequency > 1.05 * band_hz[1]]
    return float(np.mean(above)) if len(above) else 0.0


def _floor(recording: Recording, band_hz: tuple[float, float]) -> float | None:
    """Median power of a line above the band, leakage projected out."""
    samples = recording.samples
    frequency = np.fft.rfftfreq(samples, recording.period_s)
    scale = 1 / np.sqrt(samples)
    time = np.arange(samples) - (samples - 1) / 2
    position = recording.position - recording.position.mean()
    position = position - time * (time @ position) / (time @ time)
    y = np.fft.rfft(position) * scale
    power = np.abs(np.fft.rfft(recording.force - recording.force.mean()) * scale) ** 2
    inside = power[(frequency > 0.3 * band_hz[1]) & (frequency < 0.9 * band_hz[1])].mean()
    first, last = np.searchsorted(frequency, [1.05 * band_hz[1], 0.48 / recording.period_s])
    x = np.linspace(-1, 1, _LINES)
    found = []
    quiet = 3e-3  # power of the force, over that in the band, which moves nothing up there
    for start in range(first, last - _LINES, _LINES):
        lines = slice(start, start + _LINES)
        if power[lines].mean() > quiet * inside:
            continue
        basis = np.linalg.qr(leakage_terms(x, frequency[lines], frequency[[start]]))[0]
        left = y[lines] - basis @ (basis.T @ y[lines])
        shape = _of_the_sensor(recording, frequency[lines])
        found.append(np.sum(np.abs(left) ** 2 * shape) / (_LINES - basis.shape[1]))
    return float(np.median(found)) if len(found) >= _FEWEST else None
