"""The ETFE of a recording: by periods or by windows, of one piece or of several."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.read import recording_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.band import refuse_band
from bayeshaptic.recordings.response.estimators.joined import JoinedSpectra
from bayeshaptic.recordings.response.estimators.periodic_excitation import estimate_periodic
from bayeshaptic.recordings.response.estimators.random_excitation import (
    estimate_direct,
    estimate_random,
)
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.points import Points
from bayeshaptic.recordings.response.spectra import PeriodicSpectra, RandomSpectra
from bayeshaptic.recordings.signals.excitation import FEWEST_LINES
from bayeshaptic.recordings.signals.lone import without_lone
from bayeshaptic.threads import single_threaded


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
    found = mended = None
    if recording.reference is None:
        # In the mean over the periods nothing tells them from the motion any more.
        mended = without_lone(recording)
        found = estimate_periodic(mended, band_hz, fewest_tones)
    spectra: PeriodicSpectra | RandomSpectra
    spectra, points, notices = found or estimate_random(recording, band_hz, minimum_lines, mended)
    if found and mended:
        notices += _of_lone(recording, mended)
        recording = mended
    period_lines = spectra.lines if found is not None else None
    return replace(_shown(recording, spectra, points, notices), period_lines=period_lines)


def estimate_by_direct_method(recording: Recording) -> Etfe:
    """The response at all lines, for fits by the direct method, which feedback does not bias.

    The response itself is biased where a person looks at it; `DirectSpectra` says why a fit is not.

    Parameters
    ----------
    recording : Recording
        In one piece.

    Raises
    ------
    InputError
        When the recording is too short.
    """
    spectra, points = estimate_direct(recording)
    text = (
        f"All {spectra.lines} lines count, to the Nyquist frequency: in closed loop none may be "
        "left out."
    )
    return _shown(recording, spectra, points, (Notice("note", "band", text),))


def _shown(
    recording: Recording,
    spectra: PeriodicSpectra | RandomSpectra,
    points: Points,
    notices: tuple[Notice, ...],
) -> Etfe:
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
        notices=notices,
    )


def _of_lone(recording: Recording, mended: Recording) -> tuple[Notice, ...]:
    count = np.count_nonzero(recording.position != mended.position)
    if not count:
        return ()
    text = (
        f"Single positions that are far from those beside them ({count}: a bit that flipped, a "
        "pulse that was missed) were filled in before the periods were averaged."
    )
    return (Notice("note", "wild samples", text),)


def _joined(
    recording: Recording, band_hz: tuple[float, float] | None, minimum_lines: int | None
) -> Etfe:
    """That of all pieces: what a person sees is the mean of those as long as the longest.

    Pieces whose force excites nothing by itself are left out, and so are the few whose excitation
    is of another kind, periodic or not, than that of the most.
    """
    found, silent, why = [], [], None
    for number, piece in enumerate(recording.pieces, start=1):
        try:
            found.append((number, estimate_etfe(piece, band_hz, minimum_lines=minimum_lines)))
        except InputError as error:
            silent.append(number)
            why = why or error
    if not found:
        raise why or InputError(f"{recording.name}: there are no pieces")
    periodic = [isinstance(part.spectra, PeriodicSpectra) for _, part in found]
    most = sum(periodic) > len(periodic) / 2
    other = [n for (n, _), own in zip(found, periodic, strict=True) if own != most]
    parts = tuple(part for (_, part), own in zip(found, periodic, strict=True) if own == most)
    band = min(p.band_hz[0] for p in parts), max(p.band_hz[1] for p in parts)
    text = f"Band {band[0]:.3g} to {band[1]:.4g} Hz; that of each piece was chosen by itself."
    notices = {Notice("note", "band", text): None}
    notices |= dict.fromkeys(n for part in parts for n in part.notices if n.topic != "band")
    repeat = "does not repeat" if most else "repeats"
    unlike = (
        f"have a force that {repeat}, unlike the most, and the two kinds are no sum: in a study "
        "give them a level or a trial of their own, so that each kind counts"
    )
    for which, reason in ((silent, "say nothing of the response"), (other, unlike)):
        if which:
            named = ", ".join(str(number) for number in which)
            text = f"Pieces left out, {len(which)} of {len(recording.pieces)} (number {named}): "
            notices[Notice("warning", "pieces", text + f"they {reason}.")] = None
    return replace(
        mean_of_longest(parts),
        band_hz=band,
        spectra=JoinedSpectra(tuple(part.spectra for part in parts)),
        recording=recording,
        notices=tuple(notices),
        parts=parts,
    )


def mean_of_longest(parts: tuple[Etfe, ...]) -> Etfe:
    """The mean of those that have the frequencies of the longest, weighted by their variances.

    Parameters
    ----------
    parts : tuple of Etfe
        Of the pieces of a recording.

    Returns
    -------
    Etfe
        That of the longest, with what a person sees of all of them.
    """
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
