"""The ETFE: the empirical transfer function estimate of a recording, with an honest variance."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.quantities import interval, pretty_unit, pure
from bayeshaptic.recordings.read import recording_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.band import refuse_band
from bayeshaptic.recordings.response.periodic_excitation import estimate_periodic
from bayeshaptic.recordings.response.random_excitation import estimate_random
from bayeshaptic.recordings.response.spectra import (
    JoinedSpectra,
    PeriodicSpectra,
    RandomSpectra,
    Spectra,
    TableSpectra,
)
from bayeshaptic.recordings.response.windows import Reference, Windows
from bayeshaptic.recordings.signals.excitation import FEWEST_LINES
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.threads import single_threaded

__all__ = [
    "Etfe",
    "PeriodicSpectra",
    "RandomSpectra",
    "TableSpectra",
    "compress",
    "estimate_etfe",
]


@dataclass(frozen=True, repr=False)
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

    @property
    def lines(self) -> int:
        """Number of DFT lines (or rows of a table) behind the estimate."""
        return self.spectra.lines

    @property
    def unbroken(self) -> Recording | None:
        """The recording, where its samples follow each other; None for a table and for pieces."""
        return None if self.recording is None or self.recording.joints else self.recording

    @property
    def through_reference(self) -> bool:
        """Whether it was made in closed loop, and is read through what the controller followed."""
        return self.recording is not None and self.recording.reference is not None

    @property
    def relative_sd(self) -> NDArray[Any]:
        """Standard deviation over the magnitude of the estimate, shape (L,)."""
        return np.sqrt(self.variance) / np.abs(self.value)

    @property
    def kind(self) -> str:
        """ "translational" or "rotational", by the unit of the position."""
        return "rotational" if self.position_unit == "rad" else "translational"

    @property
    def stiffness_unit(self) -> str:
        return f"{'N m' if self.force_unit == 'Nm' else self.force_unit}/{self.position_unit}"

    def later(self, delay_s: float) -> Etfe:
        """A table's response with more delay in it.

        Parameters
        ----------
        delay_s : float
        """
        assert isinstance(self.spectra, TableSpectra)
        value = self.value * np.exp(-2j * np.pi * self.frequency_hz * delay_s)
        return replace(self, value=value, spectra=replace(self.spectra, value=value))

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


@at_the_door
@single_threaded
def estimate_etfe(
    recording: Recording | str | Path,
    band_hz: tuple[float, float] | None = None,
    *,
    minimum_lines: int | None = None,
    fewest_tones: int = FEWEST_LINES,
) -> Etfe:
    """Estimate the response from commanded force to position, with its variance.

    Parameters
    ----------
    recording : Recording or path
        One with a `reference` is read through that.
    band_hz : (low, high), optional
        Frequencies to use, Hz. By default chosen from the data: where the force has power and
        the response stands out of the noise.
    minimum_lines : int, optional
        DFT lines in the narrowest window of a random excitation, at least 10. By default 24, and 12
        where the recording is shorter than 10 s.
    fewest_tones : int
        Excited lines that a periodic excitation must have; fewer than 5 are for looking at alone.

    Returns
    -------
    Etfe
        With one point a window (random excitation) or an excited line (periodic).

    Raises
    ------
    InputError
        When the recording is too short, the force has no power, or the band makes no sense.
    """
    recording = recording_of(recording)
    if recording.joints:
        return _joined(recording, band_hz, minimum_lines)
    _check(recording, band_hz)
    if minimum_lines is not None and minimum_lines < 10:
        raise InputError(f"windows of {minimum_lines} lines are too narrow; use at least 10")
    found = None
    if recording.reference is None:
        found = estimate_periodic(recording, band_hz, fewest_tones)
    spectra: PeriodicSpectra | RandomSpectra
    spectra, points, notices = found or estimate_random(recording, band_hz, minimum_lines)
    return Etfe(
        frequency_hz=points.frequency_hz,
        value=points.value,
        variance=points.variance,
        coherence=points.coherence,
        period_s=recording.period_s,
        band_hz=(float(spectra.frequency_hz[0]), float(spectra.frequency_hz[-1])),
        force_unit=recording.force_unit,
        position_unit=recording.position_unit,
        spectra=spectra,
        recording=recording,
        period_lines=spectra.lines if found is not None else None,
        notices=notices,
    )


def _joined(
    recording: Recording, band_hz: tuple[float, float] | None, minimum_lines: int | None
) -> Etfe:
    """That of all pieces: what a person sees is the mean of those as long as the longest.

    Pieces whose force excites nothing by itself are left out, and so are the few whose excitation
    is of another kind, periodic or not, than that of the most.
    """
    found, left_out, why = [], [], None
    for number, piece in enumerate(recording.pieces, start=1):
        try:
            found.append((number, estimate_etfe(piece, band_hz, minimum_lines=minimum_lines)))
        except InputError as error:
            left_out.append(number)
            why = why or error
    if not found:
        raise why or InputError(f"{recording.name}: there are no pieces")
    periodic = [isinstance(part.spectra, PeriodicSpectra) for _, part in found]
    most = sum(periodic) > len(periodic) / 2
    left_out += [n for (n, _), own in zip(found, periodic, strict=True) if own != most]
    parts = [part for (_, part), own in zip(found, periodic, strict=True) if own == most]
    band = min(p.band_hz[0] for p in parts), max(p.band_hz[1] for p in parts)
    text = f"Band {band[0]:.3g} to {band[1]:.4g} Hz; that of each piece was chosen by itself."
    notices = {Notice("note", "band", text): None}
    notices |= dict.fromkeys(n for part in parts for n in part.notices if n.topic != "band")
    if left_out:
        named = ", ".join(str(number) for number in sorted(left_out))
        text = (
            f"Of {len(recording.pieces)} pieces {len(left_out)} say nothing of the response and "
            f"are left out (number {named})."
        )
        notices[Notice("warning", "pieces", text)] = None
    return replace(
        _mean_of_longest(parts),
        band_hz=band,
        spectra=JoinedSpectra(tuple(part.spectra for part in parts)),
        recording=recording,
        notices=tuple(notices),
    )


def _mean_of_longest(parts: list[Etfe]) -> Etfe:
    """The mean of those that have the frequencies of the longest, weighted by their variances."""
    longest = max(parts, key=lambda part: len(part.frequency_hz))
    alike = [
        part
        for part in parts
        if part.frequency_hz.shape == longest.frequency_hz.shape
        and np.allclose(part.frequency_hz, longest.frequency_hz)
    ]
    weight = 1 / np.array([part.variance for part in alike])
    return replace(
        longest,
        value=np.sum(weight * [part.value for part in alike], axis=0) / weight.sum(axis=0),
        variance=1 / weight.sum(axis=0),
        coherence=np.mean([part.coherence for part in alike], axis=0),
    )


def _check(recording: Recording, band_hz: tuple[float, float] | None) -> None:
    """What no estimate can be made from."""
    for name, values in (("force", recording.force), ("position", recording.position)):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise InputError(
                f"{recording.name}: {name} is {values[bad[0]]} in sample {bad[0] + 1} "
                f"({len(bad)} such samples)"
            )
        if np.ptp(values) == 0:
            raise InputError(
                f"{recording.name}: the {name} is {values[0]:g} in all {len(values)} samples; "
                "a frequency response needs a force that varies and a position that answers"
            )
    refuse_band(band_hz, recording.period_s)


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
