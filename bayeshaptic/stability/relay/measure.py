"""Gain margin and frequency from a relay experiment.

A relay, force = -h sign(position), makes the device oscillate near the frequency where the phase
of its sampled response is -180 degrees; the gain there is the critical stiffness (K. J. Astrom and
T. Hagglund, Automatica 20, 1984).  Force and position are recorded, so their ratio at the
oscillation is the sampled response itself, without the describing function's approximation.  Its
phase is not exactly -180 degrees, though: a relay that switches at samples does so between 0 and 1
period late, where a held stiffness is late by half a period, so it may settle anywhere within

    |phase + 180 degrees| <= 180 degrees * f T.

Where the oscillation wanders in frequency (as it does in a hand), the dynamic stiffness U/Y around
it can be followed to the crossing; where it is locked to whole samples, it cannot, and the
measurement says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.recordings.read import recording_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.switching import stretches
from bayeshaptic.stability.relay.estimate import estimate, jackknife, oscillation_share
from bayeshaptic.stability.relay.measurement import RelayMeasurement, relative_db
from bayeshaptic.stability.relay.notices import LEAST_STEADY_S, notices_of, one_of_several
from bayeshaptic.stability.relay.spectra import spectra_of, steady_from
from bayeshaptic.types import Floats

SEGMENT = 2048  # samples, where the recording is long enough
LEAST_SEGMENTS = 8
# A relay's force is at its two levels, if they wander (34 % of noise and 63 % of a sine are
# as near), and its sign and the position's are those of one oscillation, up to a delay in samples.
_NEAR_LEVEL = 0.4
_AT_LEVEL = 0.8
_TOGETHER = 0.3  # 0.02 of a binary sequence in open loop


@dataclass(frozen=True)
class _Part:
    """The part of a recording about one set point; `force` and `position` of shape (N,)."""

    force: Floats
    position: Floats
    began: int
    middle: float
    one_of_several: bool


def _about_one_set_point(recording: Recording) -> _Part:
    """All of a recording, or the stretch with the most switches where the set point changes.

    Raises
    ------
    InputError
        Where force or position never changes.
    """
    force, position = np.asarray(recording.force), np.asarray(recording.position)
    if np.ptp(force) == 0 or np.ptp(position) == 0:
        raise InputError(
            f"{recording.name}: {'force' if np.ptp(force) == 0 else 'position'} never changes; "
            "a relay experiment has a force that switches and a position that oscillates"
        )
    about = stretches(force, position)
    if len(about) <= 1:
        return _Part(force, position, 0, float(np.median(position)), False)
    most = max(about, key=lambda part: part.at_places)
    own = slice(most.first, most.stop)
    return _Part(force[own], position[own], most.first, most.middle, True)


def _refuse_no_relay(part: _Part, name: str) -> None:
    """Refuse what is no relay.

    Raises
    ------
    InputError
        For a force of many levels, and for one that does not switch with the position.
    """
    force = part.force
    level = np.median(np.abs(force))
    at_level = np.mean(np.abs(np.abs(force) - level) <= _NEAR_LEVEL * level)
    if at_level < _AT_LEVEL:
        raise InputError(
            f"{name}: not a relay recording: {100 * at_level:.0f} % of the force is at the levels "
            "±h of a relay; use 'bayeshaptic report'"
        )
    signs = np.sign(force), np.sign(part.position - part.middle)
    latest = 64
    together = max(
        abs(float(np.mean(signs[0][: len(force) - lag] * signs[1][lag:])))
        for lag in range(0, min(latest, len(force) // 2))
    )
    if together < _TOGETHER:
        raise InputError(
            f"{name}: not a relay recording: the force does not switch with the position (their "
            f"signs correlate by {together:.2f} at most); use 'bayeshaptic report'"
        )


def _segment(samples: int, name: str) -> int:
    """How many samples a segment has, an even number.

    Raises
    ------
    InputError
        Where segments would be too short.
    """
    segment = min(SEGMENT, 2 * samples // (LEAST_SEGMENTS + 1) // 2 * 2)
    shortest = 64
    if segment < shortest:
        raise InputError(
            f"{name}: {samples} samples are too few for a relay measurement; record at least "
            f"{LEAST_STEADY_S:g} s of steady oscillation"
        )
    return segment


@at_the_door
def measure_relay(recording: Recording | str | Path) -> RelayMeasurement:
    """Gain margin and frequency of a relay experiment.

    Parameters
    ----------
    recording : Recording or path
        Force and position of a loop closed through a relay, the transient at the beginning
        included or not.

    Returns
    -------
    RelayMeasurement
        With warnings where the oscillation is not steady, far from sinusoidal, or short.

    Raises
    ------
    InputError
        Where the recording is none of a relay, or nothing oscillates, or for too short to tell.
    """
    recording = recording_of(recording)
    part = _about_one_set_point(recording)
    _refuse_no_relay(part, recording.name)
    segment = _segment(len(part.force), recording.name)
    first = steady_from(part.force, part.position, recording.period_s, segment)
    force, position = part.force[first:], part.position[first:]
    spectra = spectra_of(force, position, recording.period_s, segment)
    linear, quadratic = (estimate(spectra, order) for order in (1, 2))
    sd = jackknife(spectra, quadratic)
    # A curved response: half of what the curvature brought is an error of the next order.
    curved = 0.5 * abs(np.log(quadratic.critical / linear.critical))
    log_sd = float(np.hypot(sd["critical"], curved))
    reach = abs(quadratic.crossing_hz - quadratic.frequency_hz) < 0.2 * quadratic.frequency_hz
    certain_db = 0.7  # a critical stiffness that is less certain than this is none
    known = bool(reach and relative_db(log_sd) < certain_db)
    began, end = part.began + first, part.began + len(part.force)
    measured = RelayMeasurement(
        frequency_hz=quadratic.frequency_hz,
        frequency_sd_hz=float(np.hypot(sd["frequency_hz"], spectra.bin_hz / np.sqrt(12))),
        gain_margin=quadratic.gain,
        gain_margin_sd=quadratic.gain * sd["gain"],
        phase_deg=quadratic.phase_deg,
        phase_bound_deg=180 * quadratic.frequency_hz * recording.period_s,
        critical_stiffness=quadratic.critical if known else None,
        critical_stiffness_sd=quadratic.critical * log_sd if known else None,
        crossing_hz=quadratic.crossing_hz if known else None,
        unit=unit_of("stiffness", recording.force_unit, recording.position_unit),
        steady_s=(began * recording.period_s, end * recording.period_s),
        share=oscillation_share(spectra, quadratic.frequency_hz),
        set_point=part.middle,
    )
    found = notices_of(measured, recording, force, position, segment)
    if part.one_of_several:
        found.insert(0, one_of_several(measured, recording.position_unit))
    return replace(measured, notices=(*recording.notices, *found))
