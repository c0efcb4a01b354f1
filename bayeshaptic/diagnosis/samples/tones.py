"""Lines of the spectrum far above their neighbours: mains hum and other tones in the position.

Random excitation: in windows of neighbouring lines, what neither a smooth response to the force nor
leakage explains.  Periodic excitation: what does not repeat with it.  Either way no model is asked.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d
from scipy.special import fdtrc

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.sinusoids import Tone, Tones
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.local_polynomial import leakage_terms
from bayeshaptic.recordings.response.windows import Reference
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.types import Complexes, Floats

Indices = NDArray[np.intp]

_HALF = 20  # lines to each side
# What rounding in double precision may leave of a simulated position, over its rms: a recording
# without noise has tones of a hundredth of that.
_ROUNDING = 1e-9
# Where the power of the force at a line is more than this many times the median of those around it,
# what is left there may be a response that is not quite the device's, and is no tone.  Sweeps that
# nearly repeat have tones in 27 of 40 without this rule, and in none with it; a hum is seen in 39
# of 40 without it, and in 25 with it.  Noise reaches it at a line in a million.  The same of the
# force's size: where bursts come at equal times an actuator that is weaker one way makes tones of
# them, which hid it (1.05 and 1.14 times the limit). Of 40 hums under other such sweeps 31 are seen
# so, 35 without, and all of 40 under noise.
_PEAK = 20.0


class _Lines:
    """DFT of a recording in a band, with what belongs to the response at each line."""

    def __init__(
        self, recording: Recording, band_hz: tuple[float, float], reference: Reference
    ) -> None:
        found = find_repetition(recording.force)
        self.start, stop, self.periods = 0, recording.samples, 0
        if found is not None:  # whole periods, the last of them
            self.periods = (found.stop - found.start) // found.period
            self.start, stop = found.stop - self.periods * found.period, found.stop
        self.count, self.period_s = stop - self.start, recording.period_s
        frequency = np.fft.rfftfreq(self.count, self.period_s)
        first, last = np.searchsorted(frequency, band_hz)
        number = np.arange(max(first - _HALF, 1), min(last + _HALF, (self.count - 1) // 2))
        if self.periods:  # only what does not repeat
            number = number[number % self.periods != 0]
        self.number, self.frequency_hz = number, frequency[number]
        self.searched = np.flatnonzero((number >= first) & (number < last))
        self.response = reference(self.frequency_hz)
        here, scale = slice(self.start, stop), 1 / np.sqrt(self.count)
        force, position = recording.force[here], recording.position[here]
        size = np.abs(force)
        if np.ptp(size) < _ROUNDING * np.max(size):  # of two levels it says nothing
            size = np.zeros(self.count)
        self.force, self.force_size = (
            np.fft.rfft(one - one.mean())[number] * scale for one in (force, size)
        )
        self.position = np.fft.rfft(position - position.mean())[number] * scale
        self.floor = float(_ROUNDING * position.std()) ** 2

    def around(self, at: int) -> Indices:
        """The lines around one of them; at an end of the band those beside it."""
        first = min(max(at - _HALF, 0), max(len(self.number) - 2 * _HALF - 1, 0))
        return np.arange(first, min(first + 2 * _HALF + 1, len(self.number)))

    def explained(self, lines: Indices) -> Complexes:
        """Orthonormal basis of response and leakage in windows of lines, shape (..., w, c)."""
        frequency = self.frequency_hz[lines]
        first, last = frequency[..., :1], frequency[..., -1:]
        middle = 0.5 * (first + last)
        x = (frequency - middle) / (last - middle)
        response = self.response[lines][..., None]
        columns = [
            leakage_terms(x, frequency, middle),
            # What rings on at a resonance when the recording ends is as narrow as the resonance.
            response * x[..., None] ** np.arange(2),
        ]
        if not self.periods:
            columns.append(self.force[lines][..., None] * response * x[..., None] ** np.arange(3))
        basis = np.concatenate(columns, axis=-1)
        return np.linalg.qr(basis / np.linalg.norm(basis, axis=-2, keepdims=True))[0]

    def of(self, frequency_hz: float, lines: Indices | slice) -> Complexes:
        """DFT of e^(2 pi i f t), t from the first sample of the recording, at w lines."""
        apart = frequency_hz * self.period_s * self.count - self.number[lines]
        turned = 2 * np.pi * frequency_hz * self.period_s * self.start
        return self.off_by(apart) * np.exp(1j * turned)

    def off_by(self, apart: Floats) -> Complexes:
        """DFT at a line of a tone so many lines above it, t from the first sample of the DFT."""
        apart = np.where(np.abs(apart) < 1e-9, 1e-9, apart)
        half = np.pi * apart / self.count
        kernel = np.sin(np.pi * apart) / np.sin(half) / np.sqrt(self.count)
        return np.asarray(kernel * np.exp(1j * half * (self.count - 1)))


class _Windows(NamedTuple):
    """G windows of w neighbouring lines, and the F tones that each is searched for.

    Attributes
    ----------
    lines : ndarray, shape (G, w)
    basis : ndarray, shape (G, w, c)
        What is explained among them.
    frequency_hz : ndarray, shape (G, F)
        Of the tones.
    tones : ndarray, shape (w, F)
        Their spectra, the same in every window.
    size : ndarray, shape (G, F)
        Power of what is not explained of them.
    of_force : ndarray of bool, shape (G, F)
        Where the force has a tone itself.
    """

    lines: Indices
    basis: Complexes
    frequency_hz: Floats
    tones: Complexes
    size: Floats
    of_force: NDArray[np.bool_]

    def unexplained(self, values: Complexes) -> Complexes:
        """What response and leakage leave of values at the lines, shape (G, w)."""
        along = self.basis.conj().swapaxes(1, 2) @ values[..., None]
        return np.asarray(values - (self.basis @ along)[..., 0])


def find_tones(recording: Recording, band_hz: tuple[float, float], reference: Reference) -> Tones:
    """Tones in the position, each found after the stronger ones are taken off.

    Parameters
    ----------
    recording : Recording
    band_hz : (low, high)
    reference : callable
        A response whose resonances are where the device's are; no more is asked of it.
    """
    lines = _Lines(recording, band_hz, reference)
    found: list[Tone] = []
    if len(lines.number) <= 2 * _HALF or len(lines.searched) == 0:
        return Tones((), 0.0)
    windows = _windows(lines)
    strongest = score = _strongest(lines, windows)
    most = 24  # a tone that wanders takes several
    while score[0] > thresholds.LOG_CHANCE and len(found) < most:
        tone = _fitted(lines, score[1])
        lines.position = lines.position - 0.5 * tone.amplitude * lines.of(
            tone.frequency_hz, slice(None)
        )
        found.append(tone)
        score = _strongest(lines, windows)
    return Tones(tuple(found), strongest[0])


def _windows(lines: _Lines) -> list[_Windows]:
    """Overlapping windows that together judge every line once, alike ones together."""
    at_once, last = 2000, int(lines.searched[-1])
    alike: dict[tuple[int, int, bytes], list[Indices]] = {}
    for first in range(int(lines.searched[0]), last + 1, _HALF):
        judged = min(_HALF, last + 1 - first)
        around = lines.around(first + judged // 2)
        apart = lines.number[around] - lines.number[around[0]]
        alike.setdefault((first - int(around[0]), judged, apart.tobytes()), []).append(around)
    return [
        _searched(lines, np.stack(around[i : i + at_once]), slice(first, first + judged))
        for (first, judged, _), around in alike.items()
        for i in range(0, len(around), at_once)
    ]


def _searched(lines: _Lines, around: Indices, judged: slice) -> _Windows:
    """Tones on the judged lines and halfway between them: no other one loses more than a tenth."""
    number, basis = lines.number[around[0]], lines.explained(around)
    wanted = np.concatenate([number[judged], number[judged] + 0.5])
    tones = lines.off_by(wanted - number[:, None])
    explained = np.sum(np.abs(basis.conj().swapaxes(1, 2) @ tones) ** 2, axis=1)
    size = np.sum(np.abs(tones) ** 2, axis=0) - explained
    on, spacing = lines.frequency_hz[around[:, judged]], 1 / (lines.count * lines.period_s)
    frequency_hz = np.concatenate([on, on + 0.5 * spacing], axis=1)
    return _Windows(around, basis, frequency_hz, tones, size, _of_force(lines, around, judged))


def _of_force(lines: _Lines, around: Indices, judged: slice) -> NDArray[np.bool_]:
    """Where a force or its size has tones, on judged lines and halfway between, shape (G, F)."""
    beside = 1  # a line on either side, to which a tone of the force reaches
    near = np.zeros(around[:, judged].shape, dtype=bool)
    for signal in (lines.force, lines.force_size):
        power = np.abs(signal[around]) ** 2
        median = np.median(power, axis=1, keepdims=True)
        near |= maximum_filter1d(power, 2 * beside + 1, axis=1)[:, judged] > _PEAK * median
    return np.concatenate([near, near], axis=1)


def _strongest(lines: _Lines, windows: list[_Windows]) -> tuple[float, float]:
    """The score of the tone that stands out most from the lines beside it, and its frequency."""
    best, where = 0.0, 0.0
    own = 0.05  # of a tone, what response and leakage must leave
    for window in windows:
        left = window.unexplained(lines.position[window.lines])
        total = np.sum(np.abs(left) ** 2, axis=1, keepdims=True)
        # A tone that response and leakage can imitate is none to be seen.
        size = np.maximum(window.size, own * np.max(window.size, axis=1, keepdims=True))
        power = np.abs(left @ window.tones.conj()) ** 2 / size * ~window.of_force
        freedom = window.lines.shape[1] - window.basis.shape[2] - 1
        ratio = freedom * power / np.maximum(total - power, freedom * lines.floor + 1e-12 * total)
        at = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        with np.errstate(divide="ignore"):  # beyond what a float holds
            score = -float(np.log10(fdtrc(2, 2 * freedom, ratio[at])))
        if score > best:
            best, where = score, float(window.frequency_hz[at])
    return best - float(np.log10(2 * len(lines.searched))), where


def _fitted(lines: _Lines, near_hz: float) -> Tone:
    """Frequency and amplitude of the tone nearest to a frequency, by least squares."""
    from scipy.optimize import minimize_scalar

    around = lines.around(int(np.searchsorted(lines.frequency_hz, near_hz)))
    basis = lines.explained(around)
    spacing = 1 / (lines.count * lines.period_s)

    def unexplained(values: Complexes) -> Complexes:
        return np.asarray(values - basis @ (basis.conj().T @ values))

    left = unexplained(lines.position[around])

    def missed(frequency_hz: float) -> float:
        column = unexplained(lines.of(frequency_hz, around))
        return -float(np.abs(column.conj() @ left) ** 2 / np.sum(np.abs(column) ** 2))

    grid = near_hz + spacing * np.linspace(-1, 1, 21)
    near = grid[int(np.argmin([missed(frequency) for frequency in grid]))]
    bounds = (near - 0.1 * spacing, near + 0.1 * spacing)
    options = {"xatol": 1e-5 * spacing}
    frequency = float(minimize_scalar(missed, bounds=bounds, method="bounded", options=options).x)
    column = unexplained(lines.of(frequency, around))
    size = float(np.sum(np.abs(column) ** 2))
    value = complex(column.conj() @ left) / size
    rest = float(np.sum(np.abs(left - value * column) ** 2))
    variance = rest / max(len(around) - basis.shape[1] - 2, 1)
    # The spectrum at positive frequencies holds half of a tone.
    amplitude, sd = 2 * value, 2 * np.sqrt(0.5 * variance / size)
    # The Cramer-Rao bound of the frequency of a sinusoid whose phase is unknown.
    frequency_sd = np.sqrt(3) * sd * spacing / (np.pi * abs(amplitude))
    return Tone(frequency, float(frequency_sd), amplitude, float(sd))
