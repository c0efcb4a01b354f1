"""How a device moves beside the motion that repeats: a hand moves it, or a floor does.

A force that is not linear in the motion has another mean under such a motion.  Beside a normal
velocity of rms s, a drag |v| v becomes v (|v| + s^2 / |v|), and more where v is small; the corner
of dry friction is rounded.  The motion is measured, and used only where the sensor sees more of it
than its own noise.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, sosfiltfilt

from bayeshaptic.types import Floats

_ABOVE = 2.0  # times the sensor's noise: as much motion as noise
_TOGETHER = 9  # lines of a period, whose powers are averaged
_OF_THE_RATE = 0.4  # where a low-pass leaves everything


@dataclass(frozen=True)
class Unrepeated:
    """The motion of the motor that does not repeat, in each of the kept periods.

    Attributes
    ----------
    position, velocity : ndarray, shape (M, N)
        Their means over the periods are zero; (1, 1) zeros where there is none to be seen.
    """

    position: Floats = field(repr=False)
    velocity: Floats = field(repr=False)


NOTHING = Unrepeated(np.zeros((1, 1)), np.zeros((1, 1)))


def unrepeated_motion(position: Floats, samples: int, period_s: float) -> Unrepeated:
    """What does not repeat of a position over whole periods.

    Parameters
    ----------
    position : ndarray, shape (M N,)
    samples : int
        N, of a period.
    period_s : float
        Of sampling.
    """
    # By differences: the mean of a position that wanders ends elsewhere than it begins.
    velocity = np.gradient(position, period_s)
    highest_hz = _seen_up_to(_rest(velocity, samples), period_s)
    if highest_hz is None:
        return NOTHING
    if highest_hz < _OF_THE_RATE / period_s:
        low = butter(2, highest_hz, fs=1 / period_s, output="sos")
        position, velocity = sosfiltfilt(low, position), sosfiltfilt(low, velocity)
    return Unrepeated(_rest(position, samples), _rest(velocity, samples))


def _rest(signal: Floats, samples: int) -> Floats:
    periods = signal.reshape(-1, samples)
    count = len(periods)
    # What is in the mean of few periods moved the device, too, and is in no model: the size of what
    # differs from the mean is that of the whole.
    whole = np.sqrt(count / max(count - 1, 1))
    return np.asarray(whole * (periods - periods.mean(axis=0)))


def _seen_up_to(rest: Floats, period_s: float) -> float | None:
    """Frequency, Hz, below which a velocity (M, N) is more than noise of its position.

    None where it is nowhere.
    """
    samples = rest.shape[1]
    if len(rest) < 2:
        return None
    power = np.mean(np.abs(np.fft.rfft(rest * np.hanning(samples))) ** 2, axis=0)
    line = np.arange(1, len(power) - 1)
    power = power[line] / np.sin(2 * np.pi * line / samples) ** 2  # of the central difference
    noise = float(np.median(power[len(power) // 2 :]))
    seen = uniform_filter1d(power, _TOGETHER, mode="nearest") > _ABOVE * noise
    first = int(np.argmin(seen)) if not seen.all() else len(seen)
    return None if first == 0 else float(first / (samples * period_s))
