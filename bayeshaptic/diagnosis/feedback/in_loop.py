"""The motion of one mass fitted to a recording with feedback, and to each half of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.feedback.lacking import Lacking, with_laws
from bayeshaptic.errors import InputError
from bayeshaptic.inference.fit import MISFIT
from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.mass_in_loop import DAMPING, MASS, NAMES, SHARED
from bayeshaptic.inference.time_domain.white_force import in_white_force
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.checks.sufficiency import few_tones
from bayeshaptic.recordings.join import join_recordings
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

# Half a recording has too few strokes to say much: the halves may differ by so many of their sds.
_APART = 4.0
_FEW_PIECES = 3  # of which no two halves are made
# Share of the force (one standard deviation) that may be anything but one mass where its few tones
# cannot tell: a base that gives, eddy currents, a gain that ripples.
UNSEEN = 0.01
_CENTRAL = 1.6449  # standard deviations that hold 90 %
WORDS = {"m": "mass", "b": "viscous damping", "delay_s": "delay"}


@dataclass(frozen=True)
class InLoop:
    """The motion in the loop, fitted to the whole recording and to each of its halves.

    Attributes
    ----------
    motion : MotionFit
    halves : tuple of MotionFit
        Empty where a half is too short for itself.
    held_out : float
        Power of each half's error with the other half's values, over that with its own.
    misfit : float
        The same power over the most that the halves' standard deviations account for; above 1.3
        something is left that they do not.
    covered : float
        Share of each half's samples that lie in the 90 % band of the other half's error.
    doubts : tuple of str
        Why neither parameters nor limit can be relied on.
    questions : tuple of str
        Why no stiffness can be recommended where the parameters can be relied on.
    laws : tuple of Lacking
        Forces over the velocity that joined mass, damping and dry friction.
    """

    motion: MotionFit
    halves: tuple[MotionFit, ...]
    held_out: float
    misfit: float
    covered: float
    doubts: tuple[str, ...] = ()
    questions: tuple[str, ...] = ()
    laws: tuple[Lacking, ...] = ()


def follow_in_loop(recording: Recording) -> InLoop | None:
    """Fit the motion of one mass; None where none can be found beside the measured one."""
    found = _with_halves(recording)
    if found is None:
        return None
    # Whatever was asked of it was asked of the fit with equal weights, as its halves are.
    motion = in_white_force(found.motion, recording)
    if few_tones(recording) is not None:
        motion = _like_one_mass(motion, recording)
    return replace(found, motion=motion)


def _like_one_mass(motion: MotionFit, recording: Recording) -> MotionFit:
    """The fit with wider mass and damping, by what a single tone cannot tell from them."""
    velocity, period_s = motion.velocity(recording), recording.period_s
    faster = np.concatenate([np.gradient(velocity[span], period_s) for span in recording.spans])
    spread, size = motion.covariance.copy(), UNSEEN * float(np.std(recording.force))
    for index, moves in ((MASS, faster), (DAMPING, velocity)):
        spread[index, index] += (size / float(np.std(moves))) ** 2
    return replace(motion, covariance=spread)


def _with_halves(recording: Recording) -> InLoop | None:
    follower = _declared(recording)
    parts, late_s = _halves(recording)
    try:
        motion, laws, doubts = with_laws(recording, follower)
    except (InputError, np.linalg.LinAlgError):
        return None
    try:
        forces = motion.forces.at(motion.numbers)
        halves = tuple(
            fit_motion(part, follower, forces, motion.inside, motion.loop(part, later_s).hums)
            for part, later_s in zip(parts, (0.0, late_s), strict=True)
        )
    except (InputError, np.linalg.LinAlgError):
        doubts += ("half of the recording is not enough",)
        return InLoop(motion, (), np.inf, np.inf, 0.0, doubts, laws=laws)
    own = [half.error_on(part) for half, part in zip(halves, parts, strict=True)]
    apart = (*halves[::-1],), parts, (-late_s, late_s)
    other = [half.error_on(part, later_s) for half, part, later_s in zip(*apart, strict=True)]
    bands = [_CENTRAL * np.sqrt(np.mean(error**2)) for error in own]
    covered = [np.mean(np.abs(e) < b) for e, b in zip(other, bands[::-1], strict=True)]
    doubts += _differences(*halves)
    if not motion.converged:
        doubts += ("the fit of the motion did not settle",)
    power = _power(own)
    most = power + _APART**2 * _by_chance(halves, parts)
    misfit = _power(other) / most
    if not misfit <= MISFIT:  # a number that is none, too: of a motion that runs away
        doubts += (
            "what one half of the recording says leaves "
            f"{pure(_power(other) / power, 3)} times the error on the other half that its own "
            "values do",
        )
    return InLoop(
        motion, halves, _power(other) / power, misfit, float(np.mean(covered)), doubts, laws=laws
    )


def _by_chance(halves: tuple[MotionFit, ...], parts: tuple[Recording, ...]) -> float:
    """Power of the error that the halves' standard deviations make on each other."""
    spread = sum(half.covariance for half in halves)
    errors = []
    for half, part in zip(halves, parts, strict=True):
        loop = half.loop(part)
        values = loop.with_beginnings(loop.begun(half.inside, half.numbers), half.uneven)
        columns = loop.columns(values, half.uneven, loop.error(values, half.uneven))
        if not np.isfinite(columns).all():  # with its own values it runs away: no chance does
            return 0.0
        # Where the pieces begin, and hums, are fitted to each.
        begins = columns[:, SHARED : loop.plain - len(half.numbers)]
        own = columns[:, :SHARED]
        own = own - begins @ np.linalg.lstsq(begins, own, rcond=None)[0]
        errors.append(np.sum((own @ spread) * own, axis=1))
    return float(np.mean(np.concatenate(errors)))


def _halves(recording: Recording) -> tuple[tuple[Recording, Recording], float]:
    """The first and the second half of its way, and how much later the second begins, in s.

    Of several pieces every other one: what is between these nobody knows.
    """
    pieces = recording.pieces
    if len(pieces) > _FEW_PIECES:
        return (join_recordings(pieces[::2]), join_recordings(pieces[1::2])), 0.0
    way = np.cumsum(np.abs(np.diff(recording.position)))
    shortest = recording.samples // 4
    middle = int(np.clip(np.searchsorted(way, 0.5 * way[-1]), shortest, 3 * shortest))
    first, second = recording.part(0, middle), recording.part(middle, recording.samples)
    return (first, second), first.duration_s


def _declared(recording: Recording) -> Follower | None:
    told = recording.feedback
    if told is None:
        return None
    return Follower(*told.law(recording.period_s))


def _power(errors: list[Floats]) -> float:
    return float(np.mean(np.concatenate(errors) ** 2))


def _differences(first: MotionFit, second: MotionFit) -> tuple[str, ...]:
    """What the halves disagree about, of mass, damping and delay."""
    apart = np.abs(first.values - second.values)
    sd = np.sqrt(np.diag(first.covariance) + np.diag(second.covariance))
    return tuple(
        f"the two halves of the recording disagree about the {WORDS[name]}"
        for name, far in zip(NAMES, apart > _APART * sd, strict=True)
        if far and name in WORDS
    )
