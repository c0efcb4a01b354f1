"""Noise in the driven band, compared with noise where the force moves nothing."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.force_noise import NoiseOfForce, noise_of_force
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, RandomSpectra
from bayeshaptic.recordings.response.local_polynomial import leakage_terms
from bayeshaptic.recordings.signals.raw_signals import count_of
from bayeshaptic.types import Floats

_LINES, _FEWEST = 60, 5  # lines in a stretch above the band, and stretches that tell a floor
_TOGETHER = 3  # windows whose noise is averaged
_NEAR_OCTAVES = 0.2  # of a crossing: a mode wanders that far
_HAND_HZ, _FREE_HZ = 45.0, 20.0  # below it a hand, or a draught, moves the device


def excess_noise_test(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """How far does the noise in the driven band rise above the encoder's, and the force's?

    The noise of an encoder is the same at all frequencies, and where the force ends nothing else is
    left. What a linear device adds to it is the motion of a hand, at low frequencies, and that of a
    force which is noisy itself: the power of the response times a smooth spectrum (`force_noise`).
    So other noise that rises inside the band comes of a force that is not linear in the motion, of
    a device that changes, or of a fault of the measurement. The noise of a sensor of the force
    moves nothing, but is multiplied by the response when that is taken off. Where the force drives
    everything the fast end of the band stands for what is beyond. None where the motion is too slow
    for its encoder.
    """
    found = _noise_of(fit, etfe)
    if found is None:
        return ()
    rise = 10 * np.log10(found.noise / (found.still + _forced(found)))
    worst = int(np.argmax(rise))
    where = float(found.centre_hz[worst])
    text = f"around {where:.3g} Hz the noise is {rise[worst]:.1f} dB louder than the encoder's"
    return (Test(EXCESS_NOISE, "nonlinear", float(rise[worst]), thresholds.EXCESS_DB, where, text),)


def changing_share(fit: Fit, etfe: Etfe, frequency_hz: float | None = None) -> float:
    """Power of what changes of the response over that of the response.

    What a device does differently from moment to moment is noise of the size of that difference.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    frequency_hz : float, optional
        The largest share around it, without the noise of a device at rest; by default the median of
        the slowest octave, where friction is, with it.
    """
    found = _noise_of(fit, etfe)
    if found is None:
        return 0.0
    octaves = np.log2(found.centre_hz / found.centre_hz[0])
    if frequency_hz is None:
        return float(np.median((found.noise / found.answer)[octaves < 1]))
    usual = found.still + _forced(found)
    loud = found.noise > 10 ** (0.1 * thresholds.EXCESS_DB) * usual
    near = np.abs(octaves - np.log2(frequency_hz / found.centre_hz[0])) < _NEAR_OCTAVES
    share = (found.noise - usual) / found.answer
    return float(np.max(share[near & loud], initial=0.0))


def noise_besides(fit: Fit, etfe: Etfe) -> NoiseOfForce | None:
    """The noise of the force, where it is the louder noise; None where there is none.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    """
    found = _noise_of(fit, etfe)
    if found is None or found.force is None:
        return None
    rise = found.noise / found.still
    return found.force if rise.max() > 10 ** (0.1 * thresholds.EXCESS_DB) else None


def _forced(found: _Noise) -> Floats | float:
    """Power of a line that the noise of the force makes."""
    return found.gain * found.force.power(found.centre_hz) if found.force else 0.0


class _Noise(NamedTuple):
    """Power of a line in windows together, shape (W,): noise, a resting device's, the answer.

    `gain` is the power of the response; what `force` is there makes noise besides that at rest.
    """

    centre_hz: Floats
    noise: Floats
    still: Floats
    answer: Floats
    gain: Floats
    force: NoiseOfForce | None


def _noise_of(fit: Fit, etfe: Etfe) -> _Noise | None:
    """The noise above a hand's; None where it does not tell of the device."""
    recording, spectra = etfe.unbroken, etfe.spectra
    if recording is None or etfe.direct or not isinstance(spectra, RandomSpectra):
        return None
    rounded = 0.25  # counts a sample; rounding a slower motion does not make white noise
    if _counts_a_sample(recording) < rounded:
        return None
    # As measured, nothing discounted.  A mode narrower than a line is where the window says it is:
    # what a fit is off by there, many times smaller than the mode, would be louder than the noise.
    windows = RandomSpectra.windows(spectra, fit.response)
    own = RandomSpectra.windows(spectra)
    lines = np.maximum(windows.lines - 3, 1.0)
    left = np.minimum(windows.scatter, own.scatter)
    scatter = left - (windows.lines - lines) * spectra.floor  # a line's for each line
    centre = windows.frequency_hz[:, 1]
    driven = centre > (_HAND_HZ if fit.model.held else _FREE_HZ)
    if driven.sum() < _TOGETHER:
        return None
    shape = _of_the_sensor(recording, centre)

    def together(power: Floats) -> Floats:
        return np.convolve(power[driven], np.ones(_TOGETHER), "valid")

    middle = centre[driven][_TOGETHER // 2 : -(_TOGETHER // 2)]
    noise = together(scatter * shape) / together(lines)
    floor = _floor(recording, etfe.band_hz)
    if floor is None:
        floor = _floor_inside(middle, noise)
    gain = np.abs(fit.response(centre)) ** 2 * shape / _TOGETHER
    force = np.full(len(centre), _of_the_force(recording, etfe.band_hz))
    if fit.model.held:
        force += _of_the_hand(centre, scatter * shape / lines / gain) / _TOGETHER
    moved = together(gain * force)
    least = together(spectra.floor * shape / _TOGETHER)
    answer = together(gain * spectra.force_power)
    still = np.maximum(floor + moved, least)
    gain = together(gain)
    besides = noise_of_force(middle, noise, still, gain, answer, together(lines))
    return _Noise(middle, noise, still, answer, gain, besides)


def _of_the_hand(centre_hz: Floats, force: Floats) -> Floats:
    """Power of a line of the hand's force, as far as slower windows tell that of it.

    A muscle follows as a mass on a spring and a damper does, so that its force falls with the
    fourth power at least: no window has more of it than any slower one leaves to it.  One alone
    would not tell: where a hand holds on behind a spring the motor moves the position little at
    the hand's own resonance, and as a force of the motor the same motion is many times larger.
    """
    beside = np.pad(force, _TOGETHER // 2, "edge")
    force = np.convolve(beside, np.full(_TOGETHER, 1 / _TOGETHER), "valid")
    told = centre_hz > _HAND_HZ / np.sqrt(2)
    left = np.minimum.accumulate(np.where(told, force * centre_hz**4, np.inf)) / centre_hz**4
    return np.where(told, left, 0.0)


def _floor_inside(centre_hz: Floats, noise: Floats) -> float:
    """Noise of a line where all frequencies are driven: of the quieter windows of the fast end.

    There the device moves least.  Where most of that end is louder than the encoder, less is seen.
    """
    octaves, quieter = 2.0, 0.25
    fast = centre_hz >= centre_hz[-1] / 2**octaves
    return float(np.quantile(noise[fast], quieter))


def _counts_a_sample(recording: Recording) -> float:
    """Mean increment in counts; infinite where there are none."""
    count = count_of(recording)
    steps = float(np.mean(np.abs(np.diff(recording.position))))
    return steps / count if count > 0 else np.inf


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
    """Median power of a line above the band, leakage projected out.

    None where that is not alike in the faster half of it.  An encoder's noise is; where positions
    were smoothed or interpolated before they were written down, what is left of it up there may be
    a millionth of what the band has.
    """
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
    if len(found) < _FEWEST:
        return None
    quiet, loud = np.quantile(found[len(found) // 2 :], [0.25, 0.75])
    alike = loud <= 10 ** (0.1 * thresholds.EXCESS_DB) * quiet
    return float(np.median(found)) if alike else None
