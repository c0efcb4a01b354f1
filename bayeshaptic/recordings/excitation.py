"""What kind of force drives the device: its period, its lines, its band."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

# A force that fell by more within an octave was cut off there: 13 dB is more than what a
# second-order filter does, less than a third-order one.
CUT_OFF = 20.0
# Power below which there is nothing but rounding.
NO_POWER = 1e-10
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


def driven_range(frequency_hz: NDArray[Any], power: NDArray[Any]) -> tuple[int, int]:
    """First and last window of the range around the strongest where the force has power.

    The range ends where the power falls by more than 13 dB in an octave, at either side: a steeper
    slope than that of coloured noise that is meant to be there.

    Parameters
    ----------
    frequency_hz, power : ndarray, shape (W,)
        Centres of windows and mean power of the force in them.
    """
    floor = NO_POWER * power.max()
    log_power, log_frequency = np.log(np.maximum(power, floor)), np.log(frequency_hz)
    octave = np.log(2)
    below = np.interp(log_frequency - octave, log_frequency, log_power)
    above = np.interp(log_frequency + octave, log_frequency, log_power)
    peak, window = int(np.argmax(power)), np.arange(len(power))
    cut_high = (below - log_power > np.log(CUT_OFF)) | (power <= floor)
    cut_low = (above - log_power > np.log(CUT_OFF)) | (power <= floor)
    low = int(np.max(window[cut_low & (window < peak)], initial=-1)) + 1
    high = int(np.min(window[cut_high & (window > peak)], initial=len(power))) - 1
    return low, high


def responds_until(excess: NDArray[Any], reach: int = 4) -> int | None:
    """The last window in which the response stands out of the noise.

    Only the upper end is judged: at the lower end, where a hand wanders, even a faint answer is
    all that is known about the hand, and the likelihood weighs it rightly.

    Parameters
    ----------
    excess : ndarray, shape (W,)
        How far the response stands out, in standard deviations of what noise alone gives.
    reach : int
        Neighbours on each side that are judged together, so that an antiresonance or one noisy
        window does not end the range.

    Returns
    -------
    int or None
        None where nothing stands out by four standard deviations.
    """
    reach = min(reach, (len(excess) - 1) // 2)
    kernel = np.ones(2 * reach + 1)
    total = np.convolve(excess, kernel, mode="same")
    count = np.convolve(np.ones_like(excess), kernel, mode="same")
    found = np.flatnonzero(total / np.sqrt(count) > 4)
    return int(found[-1]) if len(found) else None
