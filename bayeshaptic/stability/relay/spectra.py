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
    """Spectra of S half-overlapping segments, each detrended and under a Hann window.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
    force, position : ndarray of complex, shape (S, L)
        Discrete Fourier transforms, in the units of force and position.
    """

    frequency_hz: Floats
    force: Complexes
    position: Complexes

    def only(self, segments: NDArray[np.int_]) -> PieceSpectra:
        """The spectra of some of the segments, by their indices."""
        return PieceSpectra(self.frequency_hz, self.force[segments], self.position[segments])

    @property
    def bin_hz(self) -> float:
        """Distance between lines, Hz."""
        return float(self.frequency_hz[1])


def spectra_of(force: Floats, position: Floats, period_s: float, segment: int) -> PieceSpectra:
    """Spectra of force and position, shape (N,) each, in segments of `segment` samples."""
    frequency = np.asarray(np.fft.rfftfreq(segment, period_s), float)
    return PieceSpectra(frequency, _transformed(force, segment), _transformed(position, segment))


def _transformed(signal: Floats, segment: int) -> Complexes:
    """Transforms of a signal's segments, less their straight lines, shape (S, L)."""
    segments = np.lib.stride_tricks.sliding_window_view(signal, segment)[:: segment // 2]
    line = np.linspace(-1, 1, segment)
    slope = segments @ line / (line @ line)
    flat = segments - segments.mean(axis=1, keepdims=True) - slope[:, None] * line
    return np.fft.rfft(flat * np.hanning(segment + 1)[:-1], axis=1)


def oscillation(spectra: PieceSpectra) -> tuple[float, float]:
    """Where the oscillation is, by its line in the force's power spectral density.

    Parameters
    ----------
    spectra : PieceSpectra

    Returns
    -------
    centre, width : float
        Mean frequency of the line's power and its rms width, Hz.
    """
    power = (np.abs(spectra.force) ** 2).mean(axis=0)
    power[:2] = 0.0  # what is left of a slow drift
    frequency = spectra.frequency_hz
    peak = frequency[np.argmax(power)]
    near = np.abs(frequency - peak) < max(NEAR * peak, 2.5 * spectra.bin_hz)
    weight = power[near] / power[near].sum()
    centre = float(weight @ frequency[near])
    return centre, float(np.sqrt(weight @ (frequency[near] - centre) ** 2))


def pieces(force: Floats, position: Floats, period_s: float, length: int) -> tuple[Floats, Floats]:
    """How the oscillation goes on, piece by piece.

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    period_s : float
        Sampling period, s.
    length : int
        Samples of a piece; pieces overlap by half.

    Returns
    -------
    frequency_hz, level_db : ndarray, shape (S,)
        Its frequency, and its amplitude in dB over any reference.
    """
    spectra = spectra_of(force, position, period_s, length)
    lines = [oscillation(spectra.only(np.array([k]))) for k in range(len(spectra.force))]
    frequency = np.array([centre for centre, _ in lines])
    near = np.abs(spectra.frequency_hz - frequency[:, None]) < NEAR * frequency[:, None]
    power = (near * np.abs(spectra.position) ** 2).sum(axis=1)
    return frequency, 10 * np.log10(np.maximum(power, np.finfo(float).tiny))


def steady_from(force: Floats, position: Floats, period_s: float, segment: int) -> int:
    """The first sample after the transient.

    There amplitude and frequency have settled to what the second half shows, by 3 dB and a tenth.

    Parameters
    ----------
    force, position : ndarray, shape (N,)
    period_s : float
        Sampling period, s.
    segment : int
        Samples of a piece.

    Returns
    -------
    int
        Half of the samples at most.
    """
    frequency, level = pieces(force, position, period_s, segment)
    half = len(level) // 2
    off = np.abs(level - np.median(level[half:])) > STEADY_DB
    off |= np.abs(frequency / np.median(frequency[half:]) - 1) > STEADY_SHARE
    bad = np.flatnonzero(off[:half])
    # The pieces overlap by half: the one after the next begins where a bad one ends.
    begin = (int(bad[-1]) + 2 if len(bad) else 1) * (segment // 2)
    return min(begin, len(force) // 2)
