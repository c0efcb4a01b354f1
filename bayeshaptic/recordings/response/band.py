"""The band to use: where the force has power and the response stands out of the noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.spectra import RandomSpectra

# A force that fell by more within an octave was cut off there: 13 dB is more than what a
# second-order filter does, less than a third-order one.
CUT_OFF = 20.0
# Where the power beyond a fall is this many times what it fell to, it is no noise but more signal.
# That is 6 dB: windows of 24 lines scatter by 1 dB, and the highest of many by 3 dB.  It changes
# the band of three of 160 strangers' recordings.
_RISEN = 4.0
# Power, relative to the strongest or the mean, below which there is nothing but rounding.
NO_POWER = 1e-10
# Highest frequency at which a velocity is used, over the sampling rate. There a quarter of the
# loop's response is what lies between the samples of the velocity, and at 0.44 it is most of it:
# that part a model must supply, and would be fitted to itself.
_OF_A_VELOCITY = 0.3
# Windows on each side that are judged together, so that an antiresonance or one noisy window does
# not end the range.
_NEIGHBOURS = 4


def choose_band(spectra: RandomSpectra, name: str) -> tuple[float, float]:
    """Choose the band from the data.

    Parameters
    ----------
    spectra : RandomSpectra
        Of the widest band there is.
    name : str
        What to call the recording.

    Returns
    -------
    (low, high)
        Hz.

    Raises
    ------
    InputError
        When the position follows the force nowhere.
    """
    windows, power = spectra.windows(), spectra.force_power
    low, high = driven_range(windows.frequency_hz[:, 1], power)
    # Share of the power explained, against what three columns explain of noise.
    n = windows.lines
    explained = np.sum(np.abs(windows.target) ** 2, axis=1)
    share = explained / (explained + windows.scatter)
    excess = (share - 3 / n) / np.sqrt(3 * (n - 3) / (n**2 * (n + 1)))
    last = responds_until(excess[low : high + 1])
    if last is None:
        raise InputError(
            f"{name}: the position does not follow the force at any frequency; check which column "
            "is which, or record with more force"
        )
    high = low + last
    # The last window may reach beyond the end of the force's power.
    lines = slice(spectra.edges[low], spectra.edges[high + 1])
    driven = np.abs(spectra.force[lines]) ** 2 > power[max(high - 1, low)] / CUT_OFF
    frequency = spectra.frequency_hz[lines]
    return float(frequency[0]), float(frequency[np.flatnonzero(driven)[-1]])


def driven_range(frequency_hz: NDArray[Any], power: NDArray[Any]) -> tuple[int, int]:
    """First and last window of the range around the strongest where the force has power.

    The range ends where the power falls by more than 13 dB in an octave, at either side: a steeper
    slope than that of coloured noise that is meant to be there.  Where it rises again farther out
    it was a notch, as a controller cuts one out of its command beside a resonance of the loop.

    Parameters
    ----------
    frequency_hz, power : ndarray, shape (W,)
        Centres of windows and mean power of the force in them.
    """
    # A running median keeps edges where they are, and evens out the noise of single windows.
    power = np.median(sliding_window_view(np.pad(power, 2, mode="edge"), 5), axis=1)
    floor = NO_POWER * power.max()
    log_power, log_frequency = np.log(np.maximum(power, floor)), np.log(frequency_hz)
    octave = np.log(2)
    below = np.interp(log_frequency - octave, log_frequency, log_power)
    above = np.interp(log_frequency + octave, log_frequency, log_power)
    peak, window = int(np.argmax(power)), np.arange(len(power))
    fallen, risen = np.log(CUT_OFF), log_power + np.log(_RISEN)
    higher_up = np.maximum.accumulate(log_power[::-1])[::-1] > risen
    lower_down = np.maximum.accumulate(log_power) > risen
    cut_high = ((below - log_power > fallen) & ~higher_up) | (power <= floor)
    cut_low = ((above - log_power > fallen) & ~lower_down) | (power <= floor)
    low = int(np.max(window[cut_low & (window < peak)], initial=-1)) + 1
    high = int(np.min(window[cut_high & (window > peak)], initial=len(power))) - 1
    return low, high


def responds_until(excess: NDArray[Any]) -> int | None:
    """The last window in which the response stands out of the noise.

    Only the upper end is judged: at the lower end, where a hand wanders, even a faint answer is
    all that is known about the hand, and the likelihood weighs it rightly.

    Parameters
    ----------
    excess : ndarray, shape (W,)
        How far the response stands out, in standard deviations of what noise alone gives.

    Returns
    -------
    int or None
        None where nothing stands out by four standard deviations.
    """
    reach = min(_NEIGHBOURS, (len(excess) - 1) // 2)
    kernel = np.ones(2 * reach + 1)
    total = np.convolve(excess, kernel, mode="same")
    count = np.convolve(np.ones_like(excess), kernel, mode="same")
    found = np.flatnonzero(total / np.sqrt(count) > 4)
    return int(found[-1]) if len(found) else None


def tells_until(recording: Recording) -> float:
    """The frequency up to which a recording, more than a model, tells the loop's response, Hz."""
    sensed = recording.sensed
    of_a_velocity = sensed is not None and sensed.derivatives and not sensed.measured_force
    return (_OF_A_VELOCITY if of_a_velocity else 0.5) / recording.period_s


def refuse_band(band_hz: tuple[float, float] | None, period_s: float) -> None:
    """Refuse a band that makes no sense; None is any.

    Raises
    ------
    InputError
    """
    if band_hz is None:
        return
    low, high = band_hz
    nyquist = 0.5 / period_s
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz: it must be 0 < low < high")
    if not high <= nyquist * (1 + 1e-9):
        raise InputError(
            f"band {low:g} to {high:g} Hz: it ends above the Nyquist frequency, {nyquist:g} Hz "
            f"at a period of {period_s:g} s"
        )
