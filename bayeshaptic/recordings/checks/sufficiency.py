"""Recordings that say too little of a device for a stiffness to follow from them.

Refused before anything is fitted, each with the reason and what to do: a posterior of such a
recording is its prior, or worse, a confident answer to another question.  The motion of one mass
may be followed in time all the same, and a warning then says why no stiffness comes of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.excitation import find_repetition
from bayeshaptic.recordings.signals.raw_signals import clipping, increment_unit
from bayeshaptic.recordings.signals.rough_response import rough_response
from bayeshaptic.recordings.signals.rows.runs import longest, runs
from bayeshaptic.recordings.signals.sweeps import moves_until
from bayeshaptic.types import Bools, Floats

# The coherence of two unrelated signals, averaged over twelve segments, stays below 0.2.
LEAST_COHERENCE = 0.3
# Shortest recording of a force that does not repeat, in a loop of a millisecond and slower: a dozen
# lines below 5 Hz, where a device's rigid-body crossing lies.  Without it, of 73 recordings of 1 to
# 2.5 s that another simulation made and that had a stiffness, four had one above their limit.
_SHORTEST_S, _USUAL_PERIOD_S = 2.5, 1e-3
# Twenty windows of 24 lines in the 40 % of the lines that a usual excitation covers.
FEWEST_SAMPLES = 1000
# A force that changes less often than this is a few steps.
FEWEST_CHANGES = 20
# Fewer tones than this leave more parameters than numbers.
FEWEST_TONES = 5
# Share of the recording that may pass without force, or without motion. In none of 40 clean ones of
# the bench (both devices, held and not, five excitations, at the usual force and a third of it) was
# the force ever idle; the position stood still for 9 % at most, of a weak chirp for 23 %.
MOST_IDLE = 0.33
_IDLE_S = 0.1
# So much of a force is none, but the noise of its sensor between blows: a share of what one sample
# in 2000 exceeds, since single ones may be wild.  Of 220 open loops of three simulations, and what
# comes with the package, none has less for more than 15 % of the time (one of steps).
_NOTHING, _STRONG = 0.02, 0.9995
# A standstill lasts for 0.1 s, or for as long as the motion usually takes for so many counts where
# that is shorter, 20 samples at least: dry friction holds a device at the end of steps of 50 ms. Of
# 300 open loops under noise, multisines, sweeps and binary sequences none rests for over 22 % so;
# of 60 under steps five are refused (two with 0.1 s alone), one of them without friction.
_USUAL_COUNTS = 30.0
_FEWEST = 20
# Share of the samples with a force.
_OF_ONE_SIZE = 0.99

TOO_LITTLE = "too little"  # the topic of a warning
_USUAL = (
    "record some 30 s of white noise or of a multisine (bayeshaptic simulate phantom -o noise.csv "
    "shows such a recording)"
)


class TooLittle(NamedTuple):
    """Why a recording says too little, and what to do."""

    reason: str
    cure: str


def too_little(recording: Recording) -> tuple[Notice, ...]:
    """The warning that a recording in open loop says too little, and what to do; or none."""
    looks = (look(recording) for look in _LOOKS)
    found = next((found for found in looks if found is not None), None)
    if found is None:
        return ()
    told = TooLittle(f"{TOO_LITTLE} to find a stiffness from: {found.reason}", found.cure)
    text = f"{told.reason[0].upper()}{told.reason[1:]}; {told.cure}."
    return (Notice("warning", TOO_LITTLE, text, about=told),)


def says_nothing_of_the_actuator(recording: Recording) -> list[Notice]:
    """A warning where the force has one size: what an actuator keeps of it is one share, always.

    A dead zone or a limit is then a smaller gain, to the last digit, and no test can see it.
    """
    size = np.abs(recording.force - (recording.force.max() + recording.force.min()) / 2)
    near = 1e-6 * size.max()
    acting = np.abs(recording.force) > near
    if np.count_nonzero(size[acting] >= size.max() - near) < _OF_ONE_SIZE * max(acting.sum(), 1):
        return []
    text = (
        "The force has two levels, so that what the actuator may keep back of small commands (a "
        "dead zone) or of large ones (saturation) is the same share of every one and cannot be "
        "seen; the limit would be too high by that share. Record once more with levels twice as "
        "far apart, or with noise of many levels: the response must be the same."
    )
    return [Notice("warning", "two levels", text)]


def told_too_little(notices: Iterable[Notice]) -> TooLittle | None:
    """What a warning says of a recording that says too little; None without one."""
    for notice in notices:
        if (notice.level, notice.topic) == ("warning", TOO_LITTLE):
            return TooLittle(*notice.about)
    return None


def refuse_where_told(recording: Recording | None, notices: Iterable[Notice]) -> None:
    """Refuse a recording of which `notices` say that it says too little.

    Raises
    ------
    InputError
    """
    told = told_too_little(notices)
    if told is not None and recording is not None:
        where = recording.source or recording.name
        raise InputError(f"{where}: {told.reason}; {told.cure}")


def shortest_s(period_s: float) -> float:
    """How long a recording of a force that does not repeat must be.

    A rigid body crosses where its damper leads by as much as the delay lags, w^2 = b / (m delay):
    with a delay of so many periods the crossing goes with the root of the sampling rate.
    """
    return float(_SHORTEST_S * min(np.sqrt(period_s / _USUAL_PERIOD_S), 1.0))


def _short(recording: Recording) -> TooLittle | None:
    seconds, least = recording.duration_s, shortest_s(recording.period_s)
    if seconds >= least or find_repetition(recording.force) is not None:
        return None
    reason = (
        f"{seconds:.3g} s, and at least {least:.3g} s are needed of a force that does not repeat, "
        f"at {quantity(1 / recording.period_s, 'Hz')}"
    )
    return TooLittle(reason, _together(recording))


def _together(recording: Recording) -> str:
    """What to do where more of the same would be enough: pieces count as all of them."""
    others = "" if recording.joints else ", or count it together with others of it in a study"
    return _USUAL + others


def _few_steps(recording: Recording) -> TooLittle | None:
    changes = np.abs(np.diff(recording.force)) > 1e-9 * np.ptp(recording.force)
    count = int(np.count_nonzero(changes))
    if count >= FEWEST_CHANGES:
        return None
    times = "once" if count == 1 else f"{count} times"
    reason = (
        f"the force changes {times} in {recording.duration_s:.3g} s, and a step says next to "
        "nothing of the response above a few hertz"
    )
    return TooLittle(reason, _together(recording))


def few_tones(recording: Recording) -> TooLittle | None:
    """Why so few tones as the force has say too little; None where there are enough."""
    force = recording.force - recording.force.mean()
    power = np.abs(np.fft.rfft(force * np.hanning(len(force)))) ** 2
    faint = 1e-4  # of the strongest line's power
    lines = np.flatnonzero(power > faint * power.max())
    tones = np.split(lines, np.flatnonzero(np.diff(lines) > 2) + 1)
    widest_tone = 9  # lines that a Hann window spreads a tone over, and its wander
    if len(tones) >= FEWEST_TONES or max(np.ptp(tone) for tone in tones) >= widest_tone:
        return None
    hertz = ", ".join(f"{tone.mean() / recording.duration_s:.3g}" for tone in tones)
    what = "a single tone" if len(tones) == 1 else f"{len(tones)} tones"
    reason = (
        f"the force is {what} ({hertz} Hz), and a response at {FEWEST_TONES} frequencies is the "
        "least from which masses and springs can be told apart"
    )
    return TooLittle(reason, _USUAL)


def _no_force(recording: Recording) -> TooLittle | None:
    force = np.abs(recording.force)
    idle = np.zeros(len(force), dtype=bool)
    for first, stop in zip(*runs(force <= _NOTHING * np.quantile(force, _STRONG)), strict=True):
        idle[first:stop] = stop - first >= round(_IDLE_S / recording.period_s)
    if np.mean(idle) <= MOST_IDLE:
        return None
    what = "next to zero" if force[idle].any() else "zero"
    reason = f"the force is {what} for {100 * np.mean(idle):.0f} % of the recording"
    first, stop = longest(~idle)
    if stop - first >= max(FEWEST_SAMPLES, shortest_s(recording.period_s) / recording.period_s):
        cure = f"read the longest part with force alone, --rows {first + 1}:{stop}, or record again"
        return TooLittle(reason, cure)
    return TooLittle(
        f"{reason}, and where a device coasts between blows dry friction passes for damping",
        "excite the device all the time, and record again",
    )


def share_at_rest(recording: Recording) -> float:
    """Share of the recording in which the position stays within a count for a standstill's time.

    Parameters
    ----------
    recording : Recording
    """
    return float(np.mean(_resting(recording)[1]))


def standstill(recording: Recording) -> tuple[float, int]:
    """A count of the position (0 where it has none), and for how many samples it rests at least."""
    step = increment_unit(recording.position) or 0.0
    longest = max(round(_IDLE_S / recording.period_s), _FEWEST)
    usual = np.std(recording.position[_FEWEST:] - recording.position[:-_FEWEST])
    length = int(np.clip(_FEWEST * _USUAL_COUNTS * step / (usual + 1e-300), _FEWEST, longest))
    return step, length


def _resting(recording: Recording) -> tuple[Floats, Bools]:
    """The position in parts of a standstill's length, and which of these are at rest."""
    step, length = standstill(recording)
    parts = recording.samples // length
    position = recording.position[: parts * length].reshape(parts, length)
    return position, np.ptp(position, axis=1) <= 1.01 * step


def _standstill(recording: Recording) -> TooLittle | None:
    position, resting = _resting(recording)
    still = np.mean(resting)
    if still <= MOST_IDLE or moves_until(recording):
        return None  # a sweep's band ends where it moves the device no more
    ends = clipping(recording.position)
    cut_off = (ends.low_clipped & (position[:, 0] <= ends.low)) | (
        ends.high_clipped & (position[:, 0] >= ends.high)
    )
    mostly = 0.5  # of the standstill, at an end of the range
    if np.mean(cut_off[resting]) > mostly:
        return TooLittle(
            f"the position stays at {ends.low:.4g} or {ends.high:.4g} {recording.position_unit} "
            f"for {100 * still:.0f} % of the recording: it was cut off there by its sensor, or the "
            "device leans on a stop",
            "widen the range, or keep the device in its middle, and record again",
        )
    return TooLittle(
        f"the position stands still for {100 * still:.0f} % of the recording: dry friction holds "
        "the device, or the motion is smaller than a count of the encoder",
        "excite it two or three times as strongly, so that it keeps moving, and record again",
    )


def _unanswered(recording: Recording) -> TooLittle | None:
    if find_repetition(recording.force) is not None:
        return None  # its lines are few, and their scatter between the periods says more
    follows = rough_response(recording).follows
    if follows >= LEAST_COHERENCE:
        return None
    return TooLittle(
        "the position hardly answers to the force: in the octave where it answers best their "
        f"coherence is {follows:.2f} (1 is all, {LEAST_COHERENCE:g} the least to go on)",
        "check the columns, excite the device two or three times as strongly, and record longer",
    )


_LOOKS: tuple[Callable[[Recording], TooLittle | None], ...] = (
    _short,
    _few_steps,
    few_tones,
    _no_force,
    _standstill,
    _unanswered,
)
