"""What is commanded: band-limited white noise, multisines, chirps, binary noise, steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.noise import shaped_noise

MOST_SAMPLES = 20_000_000  # five and a half hours at 1 kHz, some gigabytes on the way


@runtime_checkable
class Excitation(Protocol):
    """Something that can be commanded."""

    def samples(self, period_s: float) -> int:
        """How many samples are recorded."""

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        """Commands, N or N m.

        Parameters
        ----------
        lead : int
            Samples before the recording.
        period_s : float
            Sampling period, s.
        rng : numpy.random.Generator

        Returns
        -------
        ndarray, shape (lead + samples,)

        Raises
        ------
        InputError
            Where such a command cannot be made at that sampling period.
        """


class _Lasting:
    """What lasts as many seconds as was said."""

    seconds: float

    def samples(self, period_s: float) -> int:
        return sample_count(self.seconds, period_s)


@dataclass(frozen=True)
class WhiteNoise(_Lasting):
    """Gaussian noise with a flat spectrum between two frequencies.

    Attributes
    ----------
    rms : float
        N or N m, of the recorded part.
    upper_hz, lower_hz : float
        Edges of the band; the Nyquist frequency at most.
    seconds : float
    """

    rms: float
    upper_hz: float
    lower_hz: float = 0.0
    seconds: float = 30.0

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        if not 0 <= self.lower_hz < self.upper_hz:
            raise InputError(
                f"noise from {self.lower_hz:g} to {self.upper_hz:g} Hz is no band; "
                "give 0 <= lower_hz < upper_hz"
            )
        total = lead + self.samples(period_s)
        highest = min(self.upper_hz, 0.5 / period_s)
        if not highest - self.lower_hz > 2 / (total * period_s):
            raise InputError(
                f"noise from {self.lower_hz:g} to {self.upper_hz:g} Hz has no lines in "
                f"{total * period_s:g} s below the Nyquist frequency of {0.5 / period_s:g} Hz; "
                "choose another band"
            )

        def density(frequency: Array) -> Array:
            return ((frequency >= self.lower_hz) & (frequency <= self.upper_hz)).astype(float)

        noise = shaped_noise(density, total, period_s, rng)
        return self.rms / np.sqrt(np.mean(noise[lead:] ** 2)) * noise


@dataclass(frozen=True)
class Multisine:
    """Cosines of equal amplitude on lines of a common spacing, period after period.

    Attributes
    ----------
    rms : float
        N or N m.
    low_hz, high_hz, spacing_hz : float
        First and last line, and the distance between lines: 1/spacing_hz is the period, which must
        be a whole number of samples. The lines are multiples of the spacing.
    periods : int
        How many are recorded.
    phase : {"schroeder", "random"}
        -pi k (k - 1)/lines for line k (Schroeder 1970: a low crest factor), or uniform.
    """

    rms: float
    low_hz: float
    high_hz: float
    spacing_hz: float = 1.0
    periods: int = 30
    phase: str = "schroeder"

    def period_samples(self, period_s: float) -> int:
        """Samples in a period of the multisine; an `InputError` where they are no whole number."""
        samples = 1 / (self.spacing_hz * period_s)
        if abs(samples - round(samples)) > 1e-6:
            raise InputError(
                f"a multisine with lines {self.spacing_hz:g} Hz apart repeats after {samples:g} "
                f"samples of {period_s:g} s; choose a spacing for which that is a whole number"
            )
        return round(samples)

    def lines_hz(self, period_s: float) -> Array:
        """The excited lines, Hz, shape (lines,); an `InputError` where the band has none."""
        first = max(1, int(np.ceil(self.low_hz / self.spacing_hz - 1e-9)))
        last = int(np.floor(self.high_hz / self.spacing_hz + 1e-9))
        if last < first or 2 * last >= self.period_samples(period_s):
            raise InputError(
                f"a multisine from {self.low_hz:g} to {self.high_hz:g} Hz has no line, or lines "
                f"beyond the Nyquist frequency of {0.5 / period_s:g} Hz; choose another band"
            )
        return np.arange(first, last + 1) * self.spacing_hz

    def samples(self, period_s: float) -> int:
        return sample_count(self.periods * self.period_samples(period_s) * period_s, period_s)

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        lines = self.lines_hz(period_s)
        k = np.arange(len(lines))
        if self.phase == "schroeder":
            phase = -np.pi * k * (k - 1) / len(lines)
        elif self.phase == "random":
            phase = rng.uniform(0, 2 * np.pi, len(lines))
        else:
            raise InputError(f"unknown phase '{self.phase}'; choose schroeder or random")
        samples = self.period_samples(period_s)
        spectrum = np.zeros(samples // 2 + 1, dtype=complex)
        spectrum[np.round(lines / self.spacing_hz).astype(int)] = np.exp(1j * phase)
        period = np.fft.irfft(spectrum, samples)
        period *= self.rms / np.sqrt(np.mean(period**2))
        return period[np.arange(-lead, self.samples(period_s)) % samples]


@dataclass(frozen=True)
class Chirp(_Lasting):
    """A sine whose frequency grows by the same factor every second, up to the end of the record.

    Attributes
    ----------
    rms : float
        N or N m.
    low_hz, high_hz : float
        Where it begins, at a cycle in the record at least, and where it ends.
    seconds : float
    """

    rms: float
    low_hz: float
    high_hz: float
    seconds: float = 30.0

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        low = max(self.low_hz, 1.0 / self.seconds)
        if not low < self.high_hz <= 0.5 / period_s:
            raise InputError(
                f"a chirp from {low:g} to {self.high_hz:g} Hz has to rise, and end below the "
                f"Nyquist frequency of {0.5 / period_s:g} Hz; choose another band"
            )
        rate = np.log(self.high_hz / low) / self.seconds
        time = np.arange(self.samples(period_s)) * period_s
        sine = np.sin(2 * np.pi * low / rate * np.expm1(rate * time))
        return np.concatenate([np.zeros(lead), np.sqrt(2) * self.rms * sine])


@dataclass(frozen=True)
class BinaryNoise(_Lasting):
    """A pseudo-random binary sequence (of maximal length) between -rms and rms.

    Attributes
    ----------
    rms : float
        N or N m.
    upper_hz : float
        Half of the power lies below it: the level may change 2.5 times as often.
    seconds : float
    """

    rms: float
    upper_hz: float
    seconds: float = 30.0

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        from scipy.signal import max_len_seq

        total = lead + self.samples(period_s)
        hold = max(1, round(1 / (2.5 * self.upper_hz * period_s)))
        bits = int(np.ceil(np.log2(total / hold + 2)))
        state = rng.integers(2, size=max(bits, 2))
        state[0] = 1  # all zeros would stay
        sequence = max_len_seq(max(bits, 2), state=state, length=-(-total // hold))[0]
        return self.rms * (2.0 * np.repeat(sequence, hold)[:total] - 1)


@dataclass(frozen=True)
class Steps(_Lasting):
    """Steps between rms and -rms.

    Attributes
    ----------
    rms : float
        N or N m.
    hold_s : float
        Between two steps.
    seconds : float
    """

    rms: float
    hold_s: float = 0.5
    seconds: float = 30.0

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        step = np.floor(np.arange(self.samples(period_s)) * period_s / self.hold_s + 1e-9)
        return np.concatenate([np.zeros(lead), self.rms * np.where(step % 2 == 0, 1.0, -1.0)])


@dataclass(frozen=True)
class Prescribed:
    """Commands from an array, shape (samples,); nothing before it but rest."""

    command: Array

    def samples(self, period_s: float) -> int:
        return len(self.command)

    def force(self, lead: int, period_s: float, rng: np.random.Generator) -> Array:
        return np.concatenate([np.zeros(lead), np.asarray(self.command, dtype=float)])


def sample_count(seconds: float, period_s: float) -> int:
    """How many samples are so many seconds.

    Raises
    ------
    InputError
        For fewer than two, and for more than the bench simulates.
    """
    samples = round(seconds / period_s)
    if samples < 2:
        raise InputError(
            f"{seconds:g} s at {period_s:g} s a sample are no recording; give more seconds"
        )
    if samples > MOST_SAMPLES:
        raise InputError(
            f"{seconds:g} s at {period_s:g} s a sample are {samples:,} samples, and "
            f"{MOST_SAMPLES:,} are the most that the bench simulates; give fewer seconds"
        )
    return samples
