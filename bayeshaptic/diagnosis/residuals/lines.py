"""Signals at the lines of a measurement's spectra."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.types import Complexes, Floats


@dataclass(frozen=True)
class Lines:
    """From a signal, shape (N,), to its DFT at some lines, shape (L,).

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
    transform : callable
    """

    frequency_hz: Floats
    transform: Callable[[Floats], Complexes]

    @classmethod
    def of(cls, etfe: Etfe, recording: Recording) -> Lines:
        """Those of the spectra of a recording; of several pieces one after the other."""
        if etfe.parts:
            return cls._of_parts(etfe)
        frequency_hz: Floats = etfe.spectra.frequency_hz  # type: ignore[attr-defined]
        number = np.rint(frequency_hz * (recording.samples * recording.period_s)).astype(int)

        def transform(signal: Floats) -> Complexes:
            return np.fft.rfft(signal - signal.mean())[number] / np.sqrt(recording.samples)

        return cls(frequency_hz, transform)

    @classmethod
    def _of_parts(cls, etfe: Etfe) -> Lines:
        """Of each piece that counts, one after the other, of a signal of all samples."""
        spans = etfe.spans
        each = [cls.of(part, part.recording) for part in etfe.parts if part.recording]

        def transform(signal: Floats) -> Complexes:
            return np.concatenate(
                [one(signal[span]) for one, span in zip(each, spans, strict=True)]
            )

        return cls(np.concatenate([one.frequency_hz for one in each]), transform)

    @property
    def s(self) -> Complexes:
        """Points of the imaginary axis, shape (L,)."""
        return np.asarray(2j * np.pi * self.frequency_hz, dtype=complex)

    def __call__(self, signal: Floats) -> Complexes:
        return self.transform(signal)
