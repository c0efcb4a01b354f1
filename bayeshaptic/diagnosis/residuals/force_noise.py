"""Noise of the force itself: of a coarse or late converter, or of an amplifier that hisses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtri

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import percent, quantity
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Floats

# Power of the frequency with which it falls: white up to 1/f.
_FALLS = np.linspace(0.0, 1.0, 5)
_LEVELS = 10 ** np.linspace(-0.5, 0.5, 41)  # times the median of the louder windows
_OFF_DB = 0.3  # what a hold, and a command that comes late, do to the spectrum
# So many noises of a force are not known as such at least, and widen the limit as others do.
_MISSED = 0.01
_SPAN = 2.0  # from the lowest to the highest frequency where it is louder than all else together
# Most power of such a force, over the command's.  Friction that holds a mass most of the time makes
# noise of 0.2 to 10 times the command's power; commands that come 0.3 of a period early or late
# make 0.06 to 0.09 of it.
_MOST = 0.1


@dataclass(frozen=True)
class NoiseOfForce:
    """A force that nobody commanded, or that the record of the command has and the motor has not.

    Attributes
    ----------
    at_1_hz : float
        Power of a line, in the square of the force's unit.
    falls : float
        With which power of the frequency; zero of white noise.
    share : float
        Of the command's power, where it is louder than all else together.
    """

    at_1_hz: float
    falls: float
    share: float

    def power(self, frequency_hz: Floats) -> Floats:
        """Of a line at these frequencies.

        Parameters
        ----------
        frequency_hz : ndarray
        """
        return np.asarray(self.at_1_hz * frequency_hz**-self.falls)

    def notice(self, etfe: Etfe) -> Notice:
        """What a reader should know of it.

        Parameters
        ----------
        etfe : Etfe
            Of a recording.
        """
        recording = etfe.recording
        assert recording is not None
        frequency = np.asarray(np.fft.rfftfreq(recording.samples, recording.period_s), float)
        rms = float(np.sqrt(np.sum(self.power(frequency[frequency > 1])) / len(frequency)))
        share = percent(rms / float(recording.force.std()))
        kind = "white" if self.falls == 0 else "louder at low frequencies"
        text = (
            f"Besides the command, noise pushes the motor: {quantity(rms, recording.force_unit)} "
            f"rms, {kind}, {share} of the command's rms. An amplifier's noise, coarse steps of a "
            "converter and commands that take effect early or late look like that; a device that "
            "changes does not. The intervals allow for it."
        )
        return Notice("note", "noise of the force", text)


def noise_of_force(
    centre_hz: Floats, noise: Floats, still: Floats, gain: Floats, answer: Floats, lines: Floats
) -> NoiseOfForce | None:
    """The noise of the force that explains the noise of the position; None where none does.

    Parameters
    ----------
    centre_hz, noise, still : ndarray, shape (W,)
        Noise of a line in windows, and that without any of the force.
    gain, answer : ndarray, shape (W,)
        Power of the response, and that of the motion that the command makes.
    lines : ndarray, shape (W,)
        That the noise was read from.
    """
    loud = noise > 2 * still
    if not loud.any() or centre_hz[loud].max() < _SPAN * centre_hz[loud].min():
        return None
    sd_db = np.hypot(10 / np.log(10) / np.sqrt(lines), _OFF_DB)
    least, level, falls = min(
        (_misfit(noise, still, level * gain * centre_hz**-falls, sd_db), level, falls)
        for falls in _FALLS
        for level in _LEVELS * np.median(((noise - still) * centre_hz**falls / gain)[loud])
    )
    share = float(np.median((level * gain * centre_hz**-falls / answer)[loud]))
    if least > chdtri(len(noise), _MISSED) or share > _MOST:
        return None
    return NoiseOfForce(float(level), float(falls), share)


def _misfit(noise: Floats, still: Floats, forced: Floats, sd_db: Floats) -> float:
    """Sum of squares: where noise is louder than both, or quieter than that of the force alone.

    What a device at rest, or a hand, may do at most is no less than what it does.
    """
    above = np.maximum(np.log10(noise / (still + forced)), 0.0)
    below = np.maximum(np.log10(forced / noise), 0.0)
    return float(np.sum(((above + below) * 10 / sd_db) ** 2))
