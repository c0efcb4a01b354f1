"""Spectra of a relay experiment in pieces: the oscillation's line, and where it is steady."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.types import Complexes, Floats

STEADY_DB = 3.0  # the pieces' amplitudes stay within so much of their median
STEADY_SHARE = 0.1  # and their frequencies within so much of theirs
NEAR = 0.3  # a line reaches so far to either side, relative to its frequency


@dataclass(frozen=True)
class PieceSpectra:
    """Hann-windowed, detrended, half-overlapping segments: force and position, shape (S, L)."""

    frequency_hz: Floats
    force: Complexes
    position: Complexes

    def only(self, segments: NDArray[np.int_]) -> PieceSpectra:
        return PieceSpectra(self.frequency_hz, self.force[segments], self.position[segments])

    @property
    def bin_hz(self) -> float:
        return float(self.frequency_hz[1])


def spectra_of(force: Floats, position: Floats, period_s: float, segment: int) -> PieceSpectra:
    frequency = np.asarray(np.fft.rfftfreq(segment, period_s), float)
    return PieceSpectra(frequency, _transformed(force, segment), _transformed(position, segment))


def _transformed(signal: Floats, segment: int) -> Complexes:
    segments = np.lib.stride_tricks.sliding_window_view(signal, segment)[:: segment // 2]
    line = np.linspace(-1, 1, segment)
    slope = segments @ line / (line @ line)
    flat = segments - segments.mean(axis=1, keepdims=True) - slope[:, None] * line
    return np.fft.rfft(flat * np.hanning(segment + 1)[:-1], axis=1)


def oscillation(spectra: PieceSpectra) -> tuple[float, float]:
    """Centre and rms width of the oscillation's line in the force's power spectral density."""
    power = (np.abs(spectra.force) ** 2).mean(axis=0)
    power[:2] = 0.0  # what is left of a slow drift
    frequency = spectra.frequency_hz
    peak = frequency[np.argmax(power)]
    near = np.abs(frequency - peak) < max(NEAR * peak, 2.5 * spectra.bin_hz)
    weight = power[near] / power[near].sum()
    centre = float(weight @ frequency[near])
    return centre, float(np.sqrt(weight @ (frequency[near] - centre) ** 2))


def pieces(force: Floats, position: Floats, period_s: float, length: int) -> tuple[Floats, Floats]:
    """Frequency and amplitude (dB, any reference) of the oscillation, piece by piece."""
    spectra = spectra_of(force, position, period_s, length)
    lines = [oscillation(spectra.only(np.array([k]))) for k in range(len(spectra.force))]
    frequency = np.array([centre for centre, _ in lines])
    near = np.abs(spectra.frequency_hz - frequency[:, None]) < NEAR * frequency[:, None]
    power = (near * np.abs(spectra.position) ** 2).sum(axis=1)
    return frequency, 10 * np.log10(np.maximum(power, np.finfo(float).tiny))


def steady_from(force: Floats, position: Floats, period_s: float, segment: int) -> int:
    """The first sample after the transient: where both settle to what the second half shows."""
    frequency, level = pieces(force, position, period_s, segment)
    half = len(level) // 2
    off = np.abs(level - np.median(level[half:])) > STEADY_DB
    off |= np.abs(frequency / np.median(frequency[half:]) - 1) > STEADY_SHARE
    bad = np.flatnonzero(off[:half])
    # The pieces overlap by half: the one after the next begins where a bad one ends.
    begin = (int(bad[-1]) + 2 if len(bad) else 1) * (segment // 2)
    return min(begin, len(force) // 2)
