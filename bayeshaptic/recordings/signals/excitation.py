"""Does the force repeat itself, with what period, and which lines does it excite?"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len

from bayeshaptic.recordings.signals.rows.runs import longest

# Excited lines lie at most 50 dB below the strongest.
EXCITED = 1e-5


FEWEST_LINES = 5  # from which masses and springs can be told apart
# Of a force that was measured, the share of its power that may be noise: a seventh of its size.
NOISE = 0.02


class Repetition(NamedTuple):
    """The samples start:stop of a force repeat themselves every `period` samples, or all but."""

    start: int
    stop: int
    period: int
    noisy: bool = False

    def periods_of(self, force: NDArray[Any], first: int, count: int) -> NDArray[Any]:
        """`count` periods of the force from a sample on, shape (count, p); all the same or noisy.

        The sample after the last that repeats may be asked for: it is taken to repeat.
        """
        if self.noisy:
            return force[first : first + count * self.period].reshape(count, self.period)
        return np.broadcast_to(force[first : first + self.period], (count, self.period))


def find_repetition(
    force: NDArray[Any], tolerance: float = 1e-3, noise: float = NOISE
) -> Repetition | None:
    """Find where and with what period a force repeats itself.

    Candidates are the peaks of the autocorrelation; the shortest that repeats every sample over
    at least two periods and half of the record is taken. Something else may come first or last.
    A force that was measured repeats itself but for its noise: then all of it must.

    Parameters
    ----------
    force : ndarray, shape (N,)
    tolerance : float
        Largest difference between repeated samples, in standard deviations of the force.
    noise : float
        Largest share of the power that may not repeat; 0 allows for none.

    Returns
    -------
    Repetition or None
        None where nothing repeats.
    """
    centred = force - force.mean()
    samples, sd = len(centred), centred.std()
    if sd == 0:
        return None
    candidates = _candidates(centred)
    for period in candidates:
        same = np.abs(centred[period:] - centred[:-period]) <= tolerance * sd
        start, end = longest(same)
        stop = end + period
        enough = end - start >= period and stop - start >= samples / 2
        # A slow force of a fast loop is what it was two samples before, to the tolerance.
        if enough and centred[start : start + period].std() > 0.1 * sd:
            return Repetition(start, stop, int(period))
    for period in candidates if noise > 0 else ():
        count = samples // period
        start = samples - count * period
        if count < 2 or _between(centred[start:], count) > noise:
            continue
        found = Repetition(start, samples, int(period), noisy=True)
        if _excites_enough(found, centred) and not _shifted(centred[start:], period):
            return found
    return None


def _between(signal: NDArray[Any], periods: int) -> float:
    """Share of the power of whole periods that does not repeat, as the lines between have it."""
    power = np.abs(np.fft.rfft(signal - signal.mean())) ** 2
    return (1 - float(power[::periods].sum() / power.sum())) * periods / (periods - 1)


def _excites_enough(found: Repetition, force: NDArray[Any]) -> bool:
    """A tone or two with noise are a force whose noise may be all that there is to go on."""
    count = (found.stop - found.start) // found.period
    periods = found.periods_of(force, found.start, count)
    return len(excited_lines(periods.mean(axis=0), noise_of(periods))) >= FEWEST_LINES


def _shifted(signal: NDArray[Any], period: int) -> bool:
    """Whether what differs a period later is a part of a sample's shift: no noise, but a sweep.

    Of 80 forces with noise none correlates by more than 0.08, of 63 sweeps none by less than 0.93.
    """
    apart, slope = signal[period:] - signal[:-period], np.gradient(signal)[period:]
    return bool(abs(np.corrcoef(apart, slope)[0, 1]) > 0.5)


def _candidates(centred: NDArray[Any], most: int = 200) -> NDArray[np.int64]:
    """Lags, ascending, where the autocorrelation peaks; at most half of the record."""
    samples = len(centred)
    size = next_fast_len(2 * samples, real=True)
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


def excited_lines(period: NDArray[Any], noise: NDArray[Any] | float = 0.0) -> NDArray[np.int64]:
    """Harmonics that one period of a force excites, below the Nyquist frequency.

    Parameters
    ----------
    period : ndarray, shape (p,)
    noise : ndarray, shape (p // 2 + 1,), or float
        Power of the noise in every line: what a line holds must be fifty times as much.

    Returns
    -------
    ndarray of int
        Harmonic numbers within 50 dB of the strongest.
    """
    beyond = 50.0  # times the noise, which then biases a response by a hundredth of its error
    below = (len(period) + 1) // 2
    power = (np.abs(np.fft.rfft(period - period.mean())) ** 2)[:below]
    own = np.broadcast_to(noise, (len(period) // 2 + 1,))[:below]
    return np.flatnonzero(power > np.maximum(EXCITED * power.max(), beyond * own))


def noise_of(force: NDArray[Any]) -> NDArray[Any] | float:
    """Power of the noise in every line of the mean of periods, as its neighbours have it.

    Parameters
    ----------
    force : ndarray, shape (M, p)

    Returns
    -------
    ndarray, shape (p // 2 + 1,), or 0.0
        Zero where all periods are the same in every bit.
    """
    if np.all(force == force[0]):
        return 0.0
    count = len(force)
    apart = np.fft.rfft(force - force.mean(axis=0), axis=1)
    power = np.sum(np.abs(apart) ** 2, axis=0) / (count * (count - 1))
    width = min(21, len(power))
    return np.convolve(power, np.ones(width) / width, mode="same")
