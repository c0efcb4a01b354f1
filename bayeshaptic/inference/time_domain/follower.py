"""The feedback that keeps a simulated motion beside the measured one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.types import Floats

_POWER = 0.95  # of the command's, below the bandwidth
_LOWEST, _HIGHEST = 0.002, 0.025  # of the sampling rate
_RATIO = 0.7  # damping


@dataclass(frozen=True)
class Follower:
    """A force from the difference of measured and simulated position, sample by sample.

    Where it is the controller that was in the loop, command + feedback of the difference is what
    that controller would have commanded for the simulated position, whatever its reference was.

    Attributes
    ----------
    above, below : ndarray
        Numerator and denominator in powers of 1/z, the denominator's first coefficient 1.
    """

    above: Floats
    below: Floats


def spring_and_damper(mass: float, bandwidth_hz: float, period_s: float) -> Follower:
    """A follower that holds `mass` with a spring of that natural frequency, well damped."""
    omega = 2 * np.pi * bandwidth_hz
    spring, damper = mass * omega**2, 2 * _RATIO * mass * omega
    return Follower(np.array([spring + damper / period_s, -damper / period_s]), np.ones(1))


def bandwidth_hz(command: Floats, period_s: float) -> float:
    """Below which most of the command's power lies: there it says how the device moves."""
    window = np.hanning(len(command))
    power = np.abs(np.fft.rfft((command - command.mean()) * window)) ** 2
    edge = int(np.searchsorted(np.cumsum(power), _POWER * power.sum()))
    found = np.fft.rfftfreq(len(command), period_s)[edge]
    return float(np.clip(found, _LOWEST / period_s, _HIGHEST / period_s))
