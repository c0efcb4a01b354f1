"""The ETFE: the empirical transfer function estimate of a recording, with an honest variance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.devices.device import kind_of
from bayeshaptic.errors import Notice
from bayeshaptic.quantities import interval, pretty_unit, pure
from bayeshaptic.recordings.recording import Recording, stiffness_unit_of
from bayeshaptic.recordings.response.estimators.direct import DirectSpectra
from bayeshaptic.recordings.response.estimators.instrument import (
    HIGHEST_THROUGH_REFERENCE,
    STRONG,
    InstrumentSpectra,
)
from bayeshaptic.recordings.response.estimators.joined import JoinedSpectra
from bayeshaptic.recordings.response.spectra import PeriodicSpectra, RandomSpectra, Spectra
from bayeshaptic.recordings.response.table_spectra import TableSpectra
from bayeshaptic.recordings.response.windows import Reference, Windows
from bayeshaptic.shown import Shown, data_frame

__all__ = [
    "Etfe",
    "PeriodicSpectra",
    "RandomSpectra",
    "TableSpectra",
    "compress",
]


@dataclass(frozen=True, eq=False, repr=False)
class Etfe(Shown):
    """The measured frequency response from commanded force to position.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
        What a person sees: one point a window (random excitation), an excited line (periodic
        excitation) or a row (table).
    value : complex ndarray, shape (L,)
        Estimated response, position unit over force unit.
    variance : ndarray, shape (L,)
        E|estimate - truth|^2; the real and the imaginary part have half of it each. Where it is
        estimated, the error over its root has unit variance.
    coherence : ndarray, shape (L,)
        Share of the position's power that the force explains, 0..1; nan where it makes no sense.
    period_s : float
        Sampling period in seconds.
    band_hz : (float, float)
        Lowest and highest frequency used.
    force_unit, position_unit : str
    spectra : RandomSpectra or PeriodicSpectra or TableSpectra or JoinedSpectra
        What `compress` needs: the windows can be built from it with any reference.
    recording : Recording or None
        None for a table.
    period_lines : int or None
        Number of excited lines; None when the excitation is not periodic.
    notices : tuple of Notice
    parts : tuple of Etfe
        Those of the pieces of a recording that count, where it has several; else none.
    """

    frequency_hz: NDArray[Any]
    value: NDArray[Any]
    variance: NDArray[Any]
    coherence: NDArray[Any]
    period_s: float
    band_hz: tuple[float, float]
    force_unit: str
    position_unit: str
    spectra: Spectra = field(repr=False)
    recording: Recording | None = field(default=None, repr=False)
    period_lines: int | None = None
    notices: tuple[Notice, ...] = ()
    parts: tuple[Etfe, ...] = field(default=(), repr=False)

    @property
    def lines(self) -> int:
        """Number of DFT lines (or rows of a table) behind the estimate."""
        return self.spectra.lines

    @property
    def unbroken(self) -> Recording | None:
        """The recording, where its samples follow each other; None for a table and for pieces."""
        return None if self.recording is None or self.recording.joints else self.recording

    @property
    def spans(self) -> tuple[slice, ...]:
        """The samples of the recording that are those of each of the `parts`."""
        if self.recording is None:
            return ()
        each = zip(self.recording.pieces, self.recording.spans, strict=True)
        known = {piece.name: span for piece, span in each}
        return tuple(known[part.recording.name] for part in self.parts if part.recording)

    @property
    def through_reference(self) -> bool:
        """Whether it was made in closed loop, and is read through an instrument.

        What the controller followed, or the innovations of its command.
        """
        return self.recording is not None and self.recording.reference is not None

    @property
    def moved_throughout(self) -> bool:
        """Whether what it is read through moves the force at nearly all frequencies, as noise does.

        From the lowest window on that it moves, up to 0.4 of the sampling rate.
        """
        spectra = self.spectra
        if not isinstance(spectra, InstrumentSpectra):
            return False
        nearly = 0.9
        whole = self.band_hz[1] > nearly * HIGHEST_THROUGH_REFERENCE / self.period_s
        return whole and float(np.mean(spectra.strength > STRONG)) > nearly

    @property
    def of_a_structure(self) -> bool:
        """Whether it is a table of a continuous structure, which no loop sampled."""
        return isinstance(self.spectra, TableSpectra) and self.spectra.own_variance is not None

    @property
    def of_measured_force(self) -> bool:
        """Whether a sensor told the force, which may lag behind it."""
        sensed = None if self.recording is None else self.recording.sensed
        return self.of_a_structure or (sensed is not None and sensed.measured_force)

    @property
    def direct(self) -> bool:
        """Whether it may be biased by feedback, and is fitted so that this does not matter."""
        return isinstance(self.spectra, DirectSpectra)

    @property
    def leaks_free_motion(self) -> bool:
        """Whether all leakage is taken for the device's own free motion: see `DirectSpectra`."""
        return isinstance(self.spectra, DirectSpectra) and self.spectra.free_motions is not None

    @property
    def relative_sd(self) -> NDArray[Any]:
        """Standard deviation over the magnitude of the estimate, shape (L,)."""
        return np.sqrt(self.variance) / np.abs(self.value)

    @property
    def kind(self) -> str:
        """ "translational" or "rotational", by the unit of the position."""
        return kind_of(self.position_unit)

    @property
    def stiffness_unit(self) -> str:
        return stiffness_unit_of(self.force_unit, self.position_unit)

    @property
    def blurred(self) -> Etfe:
        """With the leakage of modes that ring on among the noise, which widens their valleys."""
        spectra = _blurred(self.spectra)
        return self if spectra is self.spectra else replace(self, spectra=spectra)

    def later(self, delay_s: float) -> Etfe:
        """A table's response with more delay in it.

        Parameters
        ----------
        delay_s : float
        """
        assert isinstance(self.spectra, TableSpectra)
        value = self.value * np.exp(-2j * np.pi * self.frequency_hz * delay_s)
        return replace(self, value=value, spectra=replace(self.spectra, value=value))

    def beside_images(self, images: NDArray[Any]) -> Etfe:
        """A structure's table with the images that a model knows, shape (L,)."""
        spectra = self.spectra
        assert isinstance(spectra, TableSpectra) and spectra.own_variance is not None
        value, variance = self.value + images, spectra.own_variance
        known = replace(spectra, value=value, variance=variance)
        return replace(self, value=value, variance=variance, spectra=known)

    @property
    def gain_db(self) -> NDArray[Any]:
        """20 log10 of the magnitude, dB re position unit over force unit, shape (L,)."""
        return 20 * np.log10(np.abs(self.value))

    @property
    def phase_deg(self) -> NDArray[Any]:
        """Unwrapped phase in degrees, shape (L,)."""
        return np.degrees(np.unwrap(np.angle(self.value)))

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a frequency: gain, phase, their errors, coherence."""
        return data_frame(
            {
                "frequency_hz": float(self.frequency_hz[i]),
                "gain_db": float(self.gain_db[i]),
                "phase_deg": float(self.phase_deg[i]),
                "relative_sd": float(self.relative_sd[i]),
                "coherence": float(self.coherence[i]),
            }
            for i in range(len(self.frequency_hz))
        )

    def _lines(self) -> tuple[str, ...]:
        of = "a table" if self.recording is None else self.recording.name
        error = 100 * float(np.median(self.relative_sd))
        return (
            f"Frequency response of {of}: {interval(*self.band_hz, 'Hz')}, {self.lines:,} lines",
            f"{self.position_unit} over {pretty_unit(self.force_unit)}, median error "
            f"{pure(error, 2)} % of its magnitude",
            f"{'random' if self.period_lines is None else 'periodic'} excitation",
        )


def _blurred(spectra: Spectra) -> Spectra:
    if isinstance(spectra, JoinedSpectra):
        parts = tuple(_blurred(part) for part in spectra.parts)
        same = all(a is b for a, b in zip(parts, spectra.parts, strict=True))
        return spectra if same else JoinedSpectra(parts)
    if isinstance(spectra, RandomSpectra) and spectra.ringing_hz is not None:
        return replace(spectra, ringing_hz=None)
    return spectra


def compress(
    etfe: Etfe, reference: Reference | None = None, inputs: NDArray[Any] | None = None
) -> Windows:
    """The windows that the likelihood uses.

    Parameters
    ----------
    etfe : Etfe
    reference : callable, optional
        A first fit, as a function of the frequency in Hz. In a window only the ratio to it has to
        be a parabola, which matters beside resonances and at low frequencies. By default a
        smooth estimate made from the data. It makes no difference for periodic excitation and
        for tables.
    inputs : complex ndarray, shape (J, L), optional
        Motions that add to the position with a coefficient each, at the lines of `etfe.spectra` and
        in the scale of its positions.
    """
    return etfe.spectra.windows(reference, inputs)
