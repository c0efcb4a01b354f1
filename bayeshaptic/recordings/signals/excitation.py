"""Does the force repeat itself, with what period, and which lines does it excite?"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.types import Floats

# Excited lines lie at most 50 dB below the strongest.
EXCITED = 1e-5


class Repetition(NamedTuple):
    """The samples start:stop of a force repeat themselves every `period` samples."""

    start: int
    stop: int
    period: int


def find_repetition(force: NDArray[Any], tolerance: float = 1e-3) -> Repetition | None:
    """Find where and with what period a force repeats itself.

    Candidates are the peaks of the autocorrelation; the shortest that repeats every sample over
    at least two periods and half of the record is taken. Something else may come first or last.

    Parameters
    ----------
    force : ndarray, shape (N,)
    tolerance : float
        Largest difference between repeated samples, in standard deviations of the force.

    Returns
    -------
    Repetition or None
        None where nothing repeats.
    """
    centred = force - force.mean()
    samples, sd = len(centred), centred.std()
    if sd == 0:
        return None
    for period in _candidates(centred):
        same = np.abs(centred[period:] - centred[:-period]) <= tolerance * sd
        start, run = _longest_run(same)
        stop = start + run + period
        enough = run >= period and stop - start >= samples / 2
        if enough and centred[start:stop].std() > 0.1 * sd:
            return Repetition(start, stop, int(period))
    return None


def _candidates(centred: NDArray[Any], most: int = 200) -> NDArray[np.int64]:
    """Lags, ascending, where the autocorrelation peaks; at most half of the record."""
    samples = len(centred)
    size = 2 ** int(np.ceil(np.log2(2 * samples)))
    spectrum = np.abs(np.fft.rfft(centred, size)) ** 2
    lags = np.arange(2, samples // 2 + 1)
    energy = np.concatenate([[0.0], np.cumsum(centred**2)])
    overlap = np.sqrt(energy[samples - lags] * (energy[-1] - energy[lags]))
    similarity = np.fft.irfft(spectrum, size)[lags] / np.maximum(overlap, 1e-300)
    padded = np.concatenate([[-1.0], similarity, [-1.0]])
    peak = (padded[1:-1] >= padded[:-2]) & (padded[1:-1] >= padded[2:]) & (similarity > 0.3)
    best = np.flatnonzero(peak)
    best = best[np.argsort(-similarity[best], kind="stable")[:most]]
    return np.sort(lags[best])


def _longest_run(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Start and length of the longest run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]])))
    if len(edges) == 0:
        return 0, 0
    starts, lengths = edges[::2], edges[1::2] - edges[::2]
    longest = int(np.argmax(lengths))
    return int(starts[longest]), int(lengths[longest])


def excited_lines(period: NDArray[Any]) -> NDArray[np.int64]:
    """Harmonics that one period of a force excites, below the Nyquist frequency.

    Parameters
    ----------
    period : ndarray, shape (p,)

    Returns
    -------
    ndarray of int
        Harmonic numbers within 50 dB of the strongest.
    """
    power = np.abs(np.fft.rfft(period - period.mean())) ** 2
    power = power[: (len(period) + 1) // 2]
    return np.flatnonzero(power > EXCITED * power.max())


def is_sweep(force: Floats) -> bool:
    """Whether a force is, for much of the time, one tone at a time that is not slow.

    Tones are looked for in pieces of 128 samples, above four of their lines: below these a ramp is
    one, too.
    """
    piece, slowest, beside = 128, 4, 2
    of_power, of_time = 0.95, 0.2
    pieces = len(force) // piece
    if pieces == 0:
        return False
    framed = force[: pieces * piece].reshape(pieces, piece)
    spectrum = (framed - framed.mean(axis=1, keepdims=True)) * np.hanning(piece)
    power = np.abs(np.fft.rfft(spectrum, axis=1)) ** 2
    peak = np.argmax(power, axis=1)
    near = np.abs(np.arange(power.shape[1]) - peak[:, None]) <= beside
    share = np.sum(power * near, axis=1) / np.maximum(power.sum(axis=1), np.finfo(float).tiny)
    return bool(np.mean((peak >= slowest) & (share > of_power)) > of_time)
