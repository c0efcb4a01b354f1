"""Gain margin and frequency from a relay experiment.

A relay, force = -h sign(position), makes the device oscillate near the frequency where the phase
of its sampled response is -180 degrees; the gain there is the critical stiffness (K. J. Astrom and
T. Hagglund, Automatica 20, 1984).  Force and position are recorded, so their ratio at the
oscillation is the sampled response itself, without the describing function's approximation.  Its
phase is not exactly -180 degrees, though: a relay that switches at samples does so between 0 and 1
period late, where a held stiffness is late by half a period, so it may settle anywhere within

    |phase + 180 degrees| <= 180 degrees * f T.

Where the oscillation wanders in frequency (a hand sees to that), the dynamic stiffness U/Y around
it can be followed to the crossing; where it is locked to whole samples, it cannot, and the
measurement says so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.read import recording_of
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.switching import stretches
from bayeshaptic.shown import Shown
from bayeshaptic.stability.relay.estimate import estimate, jackknife, oscillation_share
from bayeshaptic.stability.relay.spectra import (
    STEADY_DB,
    STEADY_SHARE,
    pieces,
    spectra_of,
    steady_from,
)
from bayeshaptic.types import Floats

SEGMENT = 2048  # samples, where the recording is long enough
LEAST_SEGMENTS = 8
SINUSOIDAL = 0.8  # share of the motion's variance that the oscillation has
LEAST_STEADY_S = 15.0  # what Diaz and Gil recorded
# A relay's force is at its two levels, if they wander (34 % of noise and 63 % of a sine are
# as near), and its sign and the position's are those of one oscillation, up to a delay in samples.
_NEAR_LEVEL = 0.4
_AT_LEVEL = 0.8
_TOGETHER = 0.3  # 0.02 of a binary sequence in open loop


@dataclass(frozen=True, repr=False)
class RelayMeasurement(Shown):
    """What a relay experiment says.

    Attributes
    ----------
    frequency_hz, frequency_sd_hz : float
        Of the oscillation: centre of its line in the force's averaged power spectral density. The
        sd is a jackknife's, and at least that of a bin of 1/(length of a segment).
    gain_margin, gain_margin_sd : float
        abs(U/Y) there, in `unit`: the stiffness that the relay measured.
    phase_deg : float
        Phase of the response there, from -180 degrees; positive: it has not come so far yet.
    phase_bound_deg : float
        How far a relay that switches at samples may be off, 180 f T.
    critical_stiffness, critical_stiffness_sd : float or None
        U/Y followed to a phase of -180 degrees, where the recording allows that.
    crossing_hz : float or None
        The frequency of it.
    unit : str
    steady_s : tuple of float
        Begin and end of the steady part that was used.
    share : float
        The oscillation's share of the motion's variance, above half its frequency.
    set_point : float
        Middle of the oscillation: the median of the position; where the set point changes, half-way
        between the places of the switches up and down.
    notices : tuple of Notice
    """

    frequency_hz: float
    frequency_sd_hz: float
    gain_margin: float
    gain_margin_sd: float
    phase_deg: float
    phase_bound_deg: float
    critical_stiffness: float | None
    critical_stiffness_sd: float | None
    crossing_hz: float | None
    unit: str
    steady_s: tuple[float, float]
    share: float
    set_point: float
    notices: tuple[Notice, ...] = ()

    def _lines(self) -> tuple[str, ...]:
        limit = "no crossing can be read"
        if self.critical_stiffness is not None:
            limit = (
                f"critical stiffness {quantity(self.critical_stiffness, self.unit, digits=4)}, "
                f"± {self.critical_sd_db:.2f} dB, at {self.crossing_hz:.2f} Hz"
            )
        return (
            "Relay experiment: oscillates at "
            f"{self.frequency_hz:.2f} ± {self.frequency_sd_hz:.2f} Hz",
            f"gain margin {quantity(self.gain_margin, self.unit, digits=4)}, "
            f"± {self.gain_margin_sd_db:.2f} dB, at {self.phase_deg:+.1f} degrees from -180",
            f"{limit}; {self.steady_s[1] - self.steady_s[0]:.1f} s of steady oscillation",
        )

    @property
    def gain_margin_db(self) -> float:
        """20 log10 of the number in `unit`."""
        return float(20 * np.log10(self.gain_margin))

    @property
    def gain_margin_sd_db(self) -> float:
        return _relative_db(self.gain_margin_sd / self.gain_margin)

    @property
    def critical_db(self) -> float | None:
        """The critical stiffness in decibels, None without one."""
        found = self.critical_stiffness
        return None if found is None else float(20 * np.log10(found))

    @property
    def critical_sd_db(self) -> float | None:
        if self.critical_stiffness is None or self.critical_stiffness_sd is None:
            return None
        return _relative_db(self.critical_stiffness_sd / self.critical_stiffness)


def _refuse_no_relay(force: Floats, position: Floats, middle: float, name: str) -> None:
    """Refuse a force of many levels, and one that does not switch with the position."""
    level = np.median(np.abs(force))
    at_level = np.mean(np.abs(np.abs(force) - level) <= _NEAR_LEVEL * level)
    if at_level < _AT_LEVEL:
        raise InputError(
            f"{name}: not a relay recording: {100 * at_level:.0f} % of the force is at the levels "
            "±h of a relay; use 'bayeshaptic report'"
        )
    signs = np.sign(force), np.sign(position - middle)
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
    force, position = np.asarray(recording.force), np.asarray(recording.position)
    if np.ptp(force) == 0 or np.ptp(position) == 0:
        raise InputError(
            f"{recording.name}: {'force' if np.ptp(force) == 0 else 'position'} never changes; "
            "a relay experiment has a force that switches and a position that oscillates"
        )
    about = stretches(force, position)
    began, middle = 0, float(np.median(position))
    if len(about) > 1:
        most = max(about, key=lambda part: part.at_places)
        began, middle = most.first, most.middle
        force, position = (signal[began : most.stop] for signal in (force, position))
    _refuse_no_relay(force, position, middle, recording.name)
    segment = min(SEGMENT, 2 * len(force) // (LEAST_SEGMENTS + 1) // 2 * 2)
    if segment < 64:
        raise InputError(
            f"{recording.name}: {len(force)} samples are too few for a relay measurement; record "
            f"at least {LEAST_STEADY_S:g} s of steady oscillation"
        )
    first = steady_from(force, position, recording.period_s, segment)
    spectra = spectra_of(force[first:], position[first:], recording.period_s, segment)
    linear, quadratic = (estimate(spectra, order) for order in (1, 2))
    sd = jackknife(spectra, quadratic)
    unit = unit_of("stiffness", recording.force_unit, recording.position_unit)
    end = (began + len(force)) * recording.period_s
    share = oscillation_share(spectra, quadratic.frequency_hz)
    bound = 180 * quadratic.frequency_hz * recording.period_s
    # A curved response: half of what the curvature brought is an error of the next order.
    curved = 0.5 * abs(np.log(quadratic.critical / linear.critical))
    log_sd = float(np.hypot(sd["critical"], curved))
    reach = abs(quadratic.crossing_hz - quadratic.frequency_hz) < 0.2 * quadratic.frequency_hz
    certain_db = 0.7  # a critical stiffness that is less certain than this is none
    known = bool(reach and _relative_db(log_sd) < certain_db)
    measured = RelayMeasurement(
        quadratic.frequency_hz,
        float(np.hypot(sd["frequency_hz"], spectra.bin_hz / np.sqrt(12))),
        quadratic.gain,
        quadratic.gain * sd["gain"],
        quadratic.phase_deg,
        bound,
        quadratic.critical if known else None,
        quadratic.critical * log_sd if known else None,
        quadratic.crossing_hz if known else None,
        unit,
        ((began + first) * recording.period_s, end),
        share,
        middle,
    )
    found = _notices(measured, recording, force[first:], position[first:], segment)
    if len(about) > 1:
        found.insert(0, _one_of_several(measured, recording.position_unit))
    return replace(measured, notices=(*recording.notices, *found))


def _relative_db(relative: float) -> float:
    return float(20 / np.log(10) * relative)


def _one_of_several(measured: RelayMeasurement, unit: str) -> Notice:
    begin, end = measured.steady_s
    return Notice(
        "note",
        "set point",
        "The set point changes: what is told is of the stretch about one with the most switches, "
        f"{quantity(measured.set_point, unit)}, {begin:.3g} to {end:.3g} s.",
    )


def _notices(
    measured: RelayMeasurement, recording: Recording, force: Floats, position: Floats, segment: int
) -> list[Notice]:
    """What a person should know before quoting the numbers."""
    notices = []

    def say(level: str, topic: str, text: str) -> None:
        notices.append(Notice(level, topic, text))

    frequency, level = pieces(force, position, recording.period_s, segment)
    swing = float(np.abs(level - np.median(level)).max())
    shift = float(np.abs(frequency / np.median(frequency) - 1).max())
    if swing > STEADY_DB or shift > STEADY_SHARE:
        say(
            "warning",
            "not steady",
            f"The oscillation is not steady: over pieces of {segment * recording.period_s:.3g} s "
            f"its amplitude changes by up to {swing:.1f} dB and its frequency by up to "
            f"{100 * shift:.0f} %; the numbers are averages. Record a quieter one.",
        )
    begin, end = measured.steady_s
    if end - begin < LEAST_STEADY_S:
        say(
            "warning",
            "short",
            f"Only {end - begin:.1f} s of steady oscillation; record at least "
            f"{LEAST_STEADY_S:g} s.",
        )
    if measured.share < SINUSOIDAL:
        say(
            "warning",
            "not sinusoidal",
            f"The oscillation at {measured.frequency_hz:.4g} Hz has {100 * measured.share:.0f} % "
            "of the motion's variance: the motion is far from sinusoidal, and another frequency, "
            "friction or a free play may have part in it.",
        )
    size = np.abs(force)
    if size.std() > 0.05 * size.mean():
        say(
            "warning",
            "no relay",
            "The force has more than two values: this does not look like a relay experiment. "
            "The ratio of force and position at the strongest frequency is given all the same.",
        )
    if abs(measured.phase_deg) > 1.2 * measured.phase_bound_deg + 1:
        say(
            "warning",
            "phase",
            f"The phase is {measured.phase_deg:+.1f} degrees from -180, more than the "
            f"{measured.phase_bound_deg:.1f} of a relay that switches at samples: hysteresis, or "
            "force and position that were not logged at the same instant.",
        )
    if measured.critical_stiffness is None:
        say(
            "note",
            "no crossing",
            f"At the oscillation the phase is {measured.phase_deg:+.1f} degrees from -180 (a relay "
            f"that switches at samples may settle up to {measured.phase_bound_deg:.1f} degrees "
            "beside the crossing), and the oscillation does not wander enough to show how the "
            "response goes on from there. The gain margin is the response's at the oscillation's "
            "own frequency: compare it with a model there.",
        )
    return notices
