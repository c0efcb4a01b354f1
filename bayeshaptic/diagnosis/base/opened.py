"""A measurement that was checked, with its response."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

from bayeshaptic.devices import Device
from bayeshaptic.diagnosis.base.asked import base_model, device_of
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.models import Model
from bayeshaptic.recordings.checks.check import check_recording, check_table
from bayeshaptic.recordings.checks.sufficiency import refuse_where_told, told_too_little, too_little
from bayeshaptic.recordings.checks.unlike_pieces import unlike_pieces
from bayeshaptic.recordings.feedback import has_feedback, told
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.differences import with_differences
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.signals.lone import without_lone
from bayeshaptic.recordings.signals.other_outputs import NO_LOOP, with_loop_delay
from bayeshaptic.recordings.signals.rows.timing import unusual_period
from bayeshaptic.recordings.through_reference import through_reference, too_weak
from bayeshaptic.threads import single_threaded

_WIDEST = 0.4  # of the sampling rate: a band's upper end
_NEEDS_NONE = Notice(
    "note",
    "reference",
    "The reference is not used: one mass is followed in time, which needs none.",
)
MOST_PERIODS = 100  # of a loop's delay: haptic loops have one or two, across a network some tens


@dataclass
class Clock:
    """How long each stage took."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.seconds[name] = time.perf_counter() - began


@dataclass(frozen=True)
class Opened:
    """A measurement that was checked, with its response; attributes are those of `Analysis`.

    `asked` is the name of the base model that was asked for.
    """

    etfe: Etfe
    device: Device | None
    notices: tuple[Notice, ...]
    seconds: dict[str, float]
    lever_m: float | None
    asked: str

    @property
    def one_mass(self) -> bool:
        """Whether the device was declared to be one."""
        return self.asked == "rigid"


@single_threaded
def opened(measurement: Recording | Etfe, model: str | Model, options: Options) -> Opened:
    """Check the measurement, and estimate its response."""
    asked = base_model(model, options)
    name = asked.name if isinstance(asked, Model) else asked
    one_mass = name == "rigid"
    clock = Clock()
    device = device_of(options, asked)
    _refuse_delay(measurement.period_s, device, asked, options)
    if isinstance(measurement, Recording):
        measurement = with_differences(measurement)
    measurement, notices = with_delay_of_the_loop(measurement, device, options)
    if isinstance(measurement, Recording):
        with clock.stage("checks"):
            options.report(0.0, "checking the recording")
            # Where a sample is a piece's first, no other foretells it.
            whole = replace(without_lone(unbroken(measurement)), joints=measurement.joints)
            unread = (*notices, *told(measurement.feedback, check_recording(whole, device)))
            measurement, notices = _with_what_was_followed(measurement, unread, one_mass)
            if not any(notice.topic == "feedback" for notice in notices):
                notices += _first_of_the_period(whole, too_little(whole))
                if not one_mass:
                    _refuse_unlike(measurement, options.band_hz, notices)
                    refuse_where_told(whole, notices)
        with clock.stage("frequency response"):
            options.report(0.03, "estimating the frequency response")
            etfe, notices = _response(measurement, options.band_hz, notices, unread)
            if len(etfe.parts) == 1 and not (one_mass or has_feedback(notices)):
                # Where nothing is followed in time, the other pieces have no part in what follows.
                etfe = replace(etfe.parts[0], notices=etfe.notices)
            if not (has_feedback(notices) or etfe.through_reference):
                notices += unlike_pieces(etfe)
            notices += _not_looked_for(etfe.recording, notices)
    else:
        etfe = measurement
        if not etfe.direct:  # of a loop, whose controller biases it
            notices += check_table(etfe, device)
    lever_m = options.lever_m
    if lever_m is None and device is not None:
        lever_m = device.lever_m
    return Opened(etfe, device, notices + etfe.notices, clock.seconds, lever_m, name)


def _with_what_was_followed(
    recording: Recording, notices: tuple[Notice, ...], one_mass: bool
) -> tuple[Recording, tuple[Notice, ...]]:
    """With what the controller followed; without, where one mass is followed in time instead."""
    if not one_mass:
        return through_reference(recording, notices)
    if recording.reference is not None and has_feedback(notices):
        notices += (_NEEDS_NONE,)
    return replace(recording, reference=None), notices


def _refuse_unlike(
    recording: Recording, band_hz: tuple[float, float] | None, notices: tuple[Notice, ...]
) -> None:
    """Refuse pieces of several devices as such, where together they seem to say too little.

    With the signs of some turned round, say, they hardly answer to the force.
    """
    if told_too_little(notices) is None or not recording.joints:
        return
    try:
        found = unlike_pieces(estimate_etfe(recording, band_hz))
    except InputError:
        return
    if found:
        raise InputError(f"{recording.name}: {found[0].text}", topic="pieces")


def _first_of_the_period(recording: Recording, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """`notices` that a recording says too little; an impossible period is refused before them."""
    unusual = unusual_period(recording.period_s)
    if notices and unusual is not None:
        raise InputError(f"{recording.name}: {unusual}", topic="units")
    return notices


def _refuse_delay(
    period_s: float, device: Device | None, model: str | Model, options: Options
) -> None:
    """Refuse a delay that no loop has: every period of it costs states and time."""
    delay_s, sd_s = options.delay_s, options.delay_sd_s
    if delay_s is None and isinstance(model, Model):
        delay_s = model.fixed.get("delay_s")
    if device is not None:
        delay_s = device.delay_s if delay_s is None else delay_s
        sd_s = device.delay_sd_s if sd_s is None else sd_s
    if delay_s is None and sd_s is not None:
        raise InputError("a delay_sd_s says nothing without delay_s; give both, or neither")
    named = (("loop delay", delay_s), ("standard deviation of the loop delay", sd_s))
    for what, value in named:
        if value is not None and MOST_PERIODS * period_s < value < math.inf:
            raise InputError(
                f"a {what} of {value:g} s is {value / period_s:,.0f} sampling periods of "
                f"{period_s:g} s, and {MOST_PERIODS} are the most: it is in seconds, so "
                f"{value:g} ms are {1e-3 * value:g} and {value:g} us {1e-6 * value:g}"
            )


def with_delay_of_the_loop(
    measurement: Recording | Etfe, device: Device | None, options: Options
) -> tuple[Recording | Etfe, tuple[Notice, ...]]:
    """The measurement with the loop's delay put in, where the sensors' signals have none.

    A measured force, or a hammer's, knows nothing of the delay between command and force.  A known
    delay is put in; where it is not known, whoever reads the limit is warned.

    Raises
    ------
    InputError
        For a prior of a delay that no such measurement shows.
    """
    if not any(notice.topic == NO_LOOP for notice in measurement.notices):
        return measurement, ()
    delay_s = options.delay_s
    if delay_s is None and device is not None:
        delay_s = device.delay_s
    if delay_s is None:
        if "delay_s" in options.prior:
            raise InputError(
                "prior: a measured force shows nothing of the loop's delay; give it by --delay-s "
                "or the delay_s of [device], with delay_sd_s where it is uncertain"
            )
        text = (
            "The force was measured behind the loop's delay, and the delay is not known: the limit "
            "is that of a loop without any, and the real one is lower. Give it with --delay-s."
        )
        return measurement, (Notice("warning", NO_LOOP, text),)
    if isinstance(measurement, Recording):
        return with_loop_delay(measurement, delay_s), ()
    return measurement.later(delay_s), ()


def _not_looked_for(recording: Recording | None, notices: tuple[Notice, ...]) -> tuple[Notice, ...]:
    """A note of what no test looks for in pieces: one piece says nothing of how the next began."""
    if recording is None or not recording.joints:
        return ()
    if has_feedback(notices) or told_too_little(notices):
        return ()
    text = (
        "In several pieces taken as one neither drift nor faults of samples nor forces of an "
        "actuator are looked for. Dry friction makes the limit too high where it is not taken off "
        "(somebody holds the device) or not seen (it coasts between steps): record noise, and "
        "report on the longest piece by itself, too."
    )
    return (Notice("warning", "pieces", text),)


def _response(
    recording: Recording,
    band_hz: tuple[float, float] | None,
    notices: tuple[Notice, ...],
    unread: tuple[Notice, ...],
) -> tuple[Etfe, tuple[Notice, ...]]:
    """The estimated response, and the notices that hold with it.

    Where no band can be found, but nothing is to be read from the response either (feedback, too
    little excitation), it is estimated in the widest band, for comparison only. `unread` are the
    notices from before a reference was looked for.
    """
    try:
        return estimate_etfe(recording, band_hz), notices
    except InputError as error:
        if recording.reference is not None:
            notices = too_weak(unread, notices, str(error))
        elif not (has_feedback(notices) or told_too_little(notices)) or band_hz is not None:
            raise
    longest = max(piece.duration_s for piece in recording.pieces)
    widest = (1 / longest, _WIDEST / recording.period_s)
    return estimate_etfe(replace(recording, reference=None), widest, fewest_tones=1), notices
