"""One period of a recording whose force repeats, averaged over the kept ones."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.periodic.unrepeated import NOTHING, Unrepeated, unrepeated_motion
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import PeriodicSpectra
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class Period:
    """One period of a recording, averaged over the kept ones.

    Attributes
    ----------
    force, position : ndarray, shape (N,)
        Without mean, and without the way that the device goes on from period to period.
    harmonics : ndarray of int, shape (H,)
        Those the motion is made of, from 1.
    excited : ndarray of int, shape (L,)
        The lines of the spectra.
    scale : ndarray, shape (L,)
        From the DFT of one period to the scale of the spectra.
    period_s : float
        Of sampling.
    creep : float
        Mean velocity: a constant force, or one that a law makes, drives a free device on.
    kept : slice
        The samples of the recording that are averaged.
    unrepeated : Unrepeated
        What does not repeat.
    """

    force: Floats = field(repr=False)
    position: Floats = field(repr=False)
    harmonics: NDArray[np.int64] = field(repr=False)
    excited: NDArray[np.int64] = field(repr=False)
    scale: Floats = field(repr=False)
    period_s: float
    creep: float
    kept: slice
    unrepeated: Unrepeated = NOTHING

    @property
    def samples(self) -> int:
        return len(self.force)

    @property
    def s(self) -> Complexes:
        """j omega of the harmonics, rad/s, shape (H,)."""
        return np.asarray(2j * np.pi * self.harmonics / (self.samples * self.period_s))

    @property
    def free(self) -> NDArray[np.bool_]:
        """Harmonics below all excited ones: no force there, what moves is taken as measured."""
        return self.harmonics < self.excited[0]

    def average(self, signal: Floats) -> Floats:
        """A signal of the recording, over its kept periods, shape (N,)."""
        return signal[self.kept].reshape(-1, self.samples).mean(axis=0)

    def transform(self, signal: Floats) -> Complexes:
        """DFT of signals (..., N) at the harmonics, (..., H)."""
        return np.asarray(np.fft.rfft(signal, axis=-1)[..., self.harmonics])

    def signal(self, lines: Complexes) -> Floats:
        """Back to time, shape (N,), without mean."""
        full = np.zeros(self.samples // 2 + 1, complex)
        full[self.harmonics] = lines
        return np.fft.irfft(full, self.samples)

    def at_lines(self, lines: Complexes) -> Complexes:
        """Harmonics (..., H) to the lines of the spectra and in their scale, (..., L)."""
        return np.asarray(lines[..., self.excited - self.harmonics[0]] * self.scale)


def one_period(etfe: Etfe, witness: Floats | None = None) -> Period:
    """The averaged period of a periodic recording.

    Parameters
    ----------
    etfe : Etfe
    witness : ndarray, shape (samples,), optional
        Another position to average instead of the recording's.

    Raises
    ------
    InputError
        Where the force does not repeat or there is no recording.
    """
    recording, spectra = etfe.recording, etfe.spectra
    repetition = None if recording is None else find_repetition(recording.force)
    if recording is None or repetition is None or not isinstance(spectra, PeriodicSpectra):
        raise InputError("a steady periodic motion needs a recording whose force repeats.")
    samples = repetition.period
    stop = min(repetition.stop + 1, recording.samples)
    first = stop - spectra.periods * samples
    position = (recording.position if witness is None else witness)[first:stop]
    centres = position.reshape(-1, samples).mean(axis=1)
    creep = float(centres[-1] - centres[0]) / max((len(centres) - 1) * samples, 1)  # a sample
    position = position - creep * np.arange(len(position))
    force = repetition.periods_of(recording.force, first, spectra.periods).mean(axis=0)
    excited = np.rint(spectra.frequency_hz * samples * recording.period_s).astype(int)
    overtones = 2.0  # harmonics of the motion up to so many times the highest excited one
    last = min(int(overtones * excited[-1]), (samples - 1) // 2)
    return Period(
        force=force - force.mean(),
        position=position.reshape(-1, samples).mean(axis=0),
        harmonics=np.arange(1, last + 1),
        excited=excited,
        scale=np.abs(spectra.force) / np.abs(np.fft.rfft(force)[excited]),
        period_s=recording.period_s,
        creep=creep / recording.period_s,
        kept=slice(first, stop),
        unrepeated=unrepeated_motion(position, samples, recording.period_s),
    )


def with_floor(etfe: Etfe, floor: float) -> Etfe:
    """The same, each line's noise at least `floor` times its response.

    Parameters
    ----------
    etfe : Etfe
        Periodic.
    floor : float
        For example 0.002.
    """
    spectra = etfe.spectra
    assert isinstance(spectra, PeriodicSpectra)
    least = (spectra.freedom - 2) * (floor * np.abs(spectra.position)) ** 2
    return replace(etfe, spectra=replace(spectra, scatter=np.maximum(spectra.scatter, least)))
