"""What a person should know before quoting the numbers of a relay experiment."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.stability.relay.measurement import RelayMeasurement
from bayeshaptic.stability.relay.spectra import STEADY_DB, STEADY_SHARE, pieces
from bayeshaptic.types import Floats

SINUSOIDAL = 0.8  # share of the motion's variance that the oscillation has
LEAST_STEADY_S = 15.0  # what Diaz and Gil recorded


def one_of_several(measured: RelayMeasurement, unit: str) -> Notice:
    """A note that the set point changes, and which stretch was used; `unit` is the position's."""
    begin, end = measured.steady_s
    return Notice(
        "note",
        "set point",
        "The set point changes: what is told is of the stretch about one with the most switches, "
        f"{quantity(measured.set_point, unit)}, {begin:.3g} to {end:.3g} s.",
    )


def notices_of(
    measured: RelayMeasurement, recording: Recording, force: Floats, position: Floats, segment: int
) -> list[Notice]:
    """What a person should know before quoting the numbers.

    Parameters
    ----------
    measured : RelayMeasurement
    recording : Recording
    force, position : ndarray, shape (N,)
        Of the steady part.
    segment : int
        Samples of a segment.
    """
    return [
        *_not_steady(recording, force, position, segment),
        *_no_clean_relay(measured, force),
        *_phase(measured),
    ]


def _not_steady(
    recording: Recording, force: Floats, position: Floats, segment: int
) -> list[Notice]:
    """A warning where amplitude or frequency of the oscillation change from piece to piece."""
    frequency, level = pieces(force, position, recording.period_s, segment)
    swing = float(np.abs(level - np.median(level)).max())
    shift = float(np.abs(frequency / np.median(frequency) - 1).max())
    if swing <= STEADY_DB and shift <= STEADY_SHARE:
        return []
    text = (
        f"The oscillation is not steady: over pieces of {segment * recording.period_s:.3g} s "
        f"its amplitude changes by up to {swing:.1f} dB and its frequency by up to "
        f"{100 * shift:.0f} %; the numbers are averages. Record a quieter one."
    )
    return [Notice("warning", "not steady", text)]


def _no_clean_relay(measured: RelayMeasurement, force: Floats) -> list[Notice]:
    """Too short, more than one frequency, or more than two values of the force."""
    notices = []
    begin, end = measured.steady_s
    if end - begin < LEAST_STEADY_S:
        text = (
            f"Only {end - begin:.1f} s of steady oscillation; record at least {LEAST_STEADY_S:g} s."
        )
        notices.append(Notice("warning", "short", text))
    if measured.share < SINUSOIDAL:
        text = (
            f"The oscillation at {measured.frequency_hz:.4g} Hz has {100 * measured.share:.0f} % "
            "of the motion's variance: the motion is far from sinusoidal, and another frequency, "
            "friction or a free play may have part in it."
        )
        notices.append(Notice("warning", "not sinusoidal", text))
    size = np.abs(force)
    if size.std() > 0.05 * size.mean():
        text = (
            "The force has more than two values: this does not look like a relay experiment. "
            "The ratio of force and position at the strongest frequency is given all the same."
        )
        notices.append(Notice("warning", "no relay", text))
    return notices


def _phase(measured: RelayMeasurement) -> list[Notice]:
    """A phase that a relay does not explain; and why no crossing can be read."""
    notices = []
    if abs(measured.phase_deg) > 1.2 * measured.phase_bound_deg + 1:
        text = (
            f"The phase is {measured.phase_deg:+.1f} degrees from -180, more than the "
            f"{measured.phase_bound_deg:.1f} of a relay that switches at samples: hysteresis, or "
            "force and position that were not logged at the same instant."
        )
        notices.append(Notice("warning", "phase", text))
    if measured.critical_stiffness is None:
        text = (
            f"At the oscillation the phase is {measured.phase_deg:+.1f} degrees from -180 (a relay "
            f"that switches at samples may settle up to {measured.phase_bound_deg:.1f} degrees "
            "beside the crossing), and the oscillation does not wander enough to show how the "
            "response goes on from there. The gain margin is the response's at the oscillation's "
            "own frequency: compare it with a model there."
        )
        notices.append(Notice("note", "no crossing", text))
    return notices
