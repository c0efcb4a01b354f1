"""Sinusoids in the position: where they are, how large, and the position without them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats


@dataclass(frozen=True)
class Tone:
    """A sinusoid Re(amplitude e^(2 pi i frequency_hz t)) in the position.

    Attributes
    ----------
    frequency_hz, frequency_sd_hz : float
    amplitude : complex
    amplitude_sd : float
        Of its magnitude.
    """

    frequency_hz: float
    frequency_sd_hz: float
    amplitude: complex
    amplitude_sd: float

    @property
    def of_the_mains(self) -> bool:
        """Whether it is a harmonic of 50 or 60 Hz, to half a per cent."""
        return any(
            abs(self.frequency_hz / mains - round(self.frequency_hz / mains))
            < 0.005 * round(self.frequency_hz / mains)
            for mains in (50.0, 60.0)
        )

    def at(self, time_s: NDArray[Any]) -> NDArray[Any]:
        """The tone at instants from the first sample on."""
        return (self.amplitude * np.exp(2j * np.pi * self.frequency_hz * time_s)).real


def in_words(tones: Sequence[Tone], unit: str) -> str:
    """Where they are, and how large."""
    return ", ".join(
        f"{tone.frequency_hz:.2f} Hz ({abs(tone.amplitude):.2g} {unit}"
        f"{', mains' if tone.of_the_mains else ''})"
        for tone in tones
    )


@dataclass(frozen=True)
class Tones:
    """Tones in a position.

    Attributes
    ----------
    tones : tuple of Tone
        The strongest first. A tone that wanders in frequency is several.
    score : float
        Of the strongest line, tone or not: minus log10 of the chance that any line of a clean
        recording stands out so far.
    """

    tones: tuple[Tone, ...]
    score: float

    def apart(self, least_hz: float = 1.0) -> list[Tone]:
        """Those that are not beside a stronger one, the strongest first."""
        found: list[Tone] = []
        for tone in sorted(self.tones, key=lambda tone: -abs(tone.amplitude)):
            if all(abs(tone.frequency_hz - other.frequency_hz) > least_hz for other in found):
                found.append(tone)
        return found

    def taken_off(self, recording: Recording) -> Floats:
        """The position without them, shape (N,)."""
        time_s = np.arange(recording.samples) * recording.period_s
        position: NDArray[Any] = recording.position
        for tone in self.tones:
            position = position - tone.at(time_s)
        return position
