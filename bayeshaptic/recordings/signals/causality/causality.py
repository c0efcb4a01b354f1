"""Which signal drives which: the force the position, the position the force, or each the other.

In an open loop nothing of the position tells of the force what its own past did not say; where it
does, the force was computed from the motion, and the ETFE is biased (C. W. J. Granger,
*Econometrica* 37(3), 1969; C. A. Sims, *American Economic Review* 62(4), 1972). A controller that
reads and then commands does it within the sample, and where the position is written down late even
one sample later: there the device answers, too, but a controller opposes the motion, and a device
gives way to the force. So the sign tells them apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.causality.innovations import innovations_answer
from bayeshaptic.recordings.signals.causality.prediction import Share, predict
from bayeshaptic.recordings.signals.excitation import Repetition, find_repetition
from bayeshaptic.recordings.signals.sweeps import is_sweep
from bayeshaptic.recordings.signals.switching import is_relay, is_switched
from bayeshaptic.types import Bools, Floats

# Share of the force's error that the position's past must remove, its z, and the floor: errors
# below that share of the increments' variance are none. Band-limited signals can be predicted
# almost perfectly, and then anything seems to help: the less is left, the more of it must go. Error
# rates of all these numbers, from simulated open and closed loops, are in docs/door.md.
_LADDER = ((0.01, 5.0, 1e-2), (0.02, 5.0, 1e-4), (0.5, 20.0, 1e-12))
NOTABLE_SHARE = 0.02
NOTABLE_CORRELATION = 0.02
SIGNIFICANT = 5.0
# From here on a recording is not called open loop either.
DOUBTFUL = 4.0
# Chi-square of the innovations' answer from which on it is feedback, and from which on it may be:
# in 115 open loops it stays below 27.
_ANSWERS, _MAY_ANSWER = 40.0, 30.0
# So is a correlation as strong as this that comes and goes.
_STRONG = 0.8

_FLOOR = 1e-4
# A computed force differs from period to period by the noise of the position; a played one never.
_SAME = 1e-6
# A force that is held at its limits, but is no sequence of steps, saturates.
_FEWEST_AT_LIMIT = 10
_MOST_AT_LIMIT = 0.5
# How many times as rough as the motion a command is at least: 36 times in 40 open loops.  In two
# loops with a spring to the reference, taken for exchanged columns, the motion was 1.1 and 1.3
# times as rough as the command.
_ROUGHER = 6.0
# A device answers late and then more and more; a controller at once.
_AT_ONCE = 0.1
_SOON = 0.3


@dataclass(frozen=True)
class Causality:
    """What one signal adds to the prediction of the other.

    Attributes
    ----------
    feedback : tuple of Share
        Share of the force's one-step prediction error (variance) that the past position removes, on
        data that was not used to fit the prediction; about zero or slightly negative in an open
        loop. Once for each floor below which errors are none.
    innovations : float
        Chi-square of the answer of the force's innovations to earlier ones of the position.
    answer : Share
        Share of the position's prediction error that the past force removes.
    same_sample, next_sample : Share
        Correlation of what is new in the force with what is new in the position in the same sample,
        and in the next one beyond that. Above zero the device answers, below zero a controller.
    answers : tuple of Share
        How the position answers to what is new in the force: in the same sample, 1, 3, 6 later.
    at_limits : float
        Share of the samples at which the force is at its limits; zero where it does not saturate.
    repeats : bool
        The force repeats exactly, period by period: it cannot have been computed from a noisy
        position.
    relay : bool
        The force has two levels, and the sign of the position decides which, or it switches where
        the position passes the same places.
    smooth_position : bool
        The position is smoother than the force, as that of every mass is, or as smooth, as a
        spring's is.
    far_past : bool
        What looks like feedback the force's own far past says as well: noise that was band-passed,
        whose far past the position knows, or feedback of nothing but what the force did.
    """

    feedback: tuple[Share, ...]
    innovations: float
    answer: Share
    same_sample: Share
    next_sample: Share
    answers: tuple[Share, ...]
    at_limits: float
    repeats: bool
    relay: bool
    smooth_position: bool
    far_past: bool = False

    @property
    def has_feedback(self) -> bool:
        """The force was computed from the motion."""
        if self.relay:
            return True
        return self._position_drives(SIGNIFICANT) and not self.swapped and not self.opposite

    @property
    def doubtful(self) -> bool:
        """The force may have been computed from the motion: it cannot be decided."""
        if self.has_feedback or self.swapped or self.opposite or self.repeats:
            return False
        strong = min(self.same_sample, self.next_sample, key=lambda share: share.value)
        hardly_clear = 3.0
        bursts = strong.value < -_STRONG and strong.z < -hardly_clear
        return self._position_drives(DOUBTFUL) or bursts or self.at_limits > _MOST_AT_LIMIT

    @property
    def doubt(self) -> int:
        """2 where it has feedback, 1 where it may have, 0 for an open loop."""
        return 2 if self.has_feedback else int(self.doubtful)

    @property
    def opposite(self) -> bool:
        """The position moves against the force: one of them has the opposite sign.

        Not of a force that repeats, nor where the first later answer goes along: it swings back.
        """
        if self.repeats:
            return False
        now, soon, *late = self.answers
        later = max(late, key=lambda share: abs(share.value))
        answers = abs(now.value) / _AT_ONCE, abs(soon.value) / _SOON
        at_once = max(answers) > abs(later.value)
        clear_answer = 8.0
        clear = later.z < -clear_answer and late[0].z <= clear_answer and self._force_drives
        return clear and not at_once and not self._past_drives(SIGNIFICANT)

    @property
    def swapped(self) -> bool:
        """Position and force have each other's columns."""
        past = self._past_drives(SIGNIFICANT) and not self.repeats
        return past and not self._force_drives and not self.smooth_position and not self.relay

    @property
    def early_position(self) -> bool:
        """The position answers to the force within the sample: it is recorded a sample early."""
        clear = self.same_sample.value > NOTABLE_SHARE**0.5 and self.same_sample.z > SIGNIFICANT
        return clear and not self.has_feedback

    @property
    def removed(self) -> float:
        """Share of the error of predicting the force that the past position removes."""
        return max(share.value for share in self.feedback)

    @property
    def evidence(self) -> str:
        """What speaks for feedback, for a sentence."""
        if self._past_drives(DOUBTFUL):
            share = f"{100 * self.removed:.2g} %"
            return f"the past position removes {share} of the error of predicting it"
        if self.at_limits > _MOST_AT_LIMIT and not self._against(DOUBTFUL):
            return f"it is at its limits in {100 * self.at_limits:.0f} % of the samples"
        if not self._against(DOUBTFUL) and self.innovations > _MAY_ANSWER:
            chance = f"chi-square {self.innovations:.0f}, where chance gives some 7"
            return f"what is new in it answers to what was new in the position before ({chance})"
        instant, when = min(
            (self.same_sample, "the same"), (self.next_sample, "the next"), key=lambda s: s[0].z
        )
        return (
            f"what is new in it opposes what is new in the position in {when} sample, with a "
            f"correlation of {instant.value:.2g}"
        )

    def _position_drives(self, z: float) -> bool:
        least = _ANSWERS if z >= SIGNIFICANT else _MAY_ANSWER
        answers = self.innovations > least
        return (self._past_drives(z) or self._against(z) or answers) and not self.repeats

    def _against(self, z: float) -> bool:
        return any(
            share.value < -NOTABLE_CORRELATION and share.z < -z
            for share in (self.same_sample, self.next_sample)
        )

    def _past_drives(self, z: float) -> bool:
        # A force that is cut off hides its own past from itself.
        hidden = _LADDER[-1][0] if self.at_limits > _MOST_AT_LIMIT else 0.0
        return any(
            share.value > max(least, hidden) and share.z > significant * z / SIGNIFICANT
            for share, (least, significant, _) in zip(self.feedback, _LADDER, strict=True)
        )

    @property
    def _force_drives(self) -> bool:
        return self.answer.value > NOTABLE_SHARE and self.answer.z > SIGNIFICANT


def causality(recording: Recording) -> Causality:
    """Test which of the force and the position drives the other.

    Under a sweep what looks like feedback must do so with shorter stretches for the cross-fit, too:
    few long ones hold other frequencies than those beside them, predictions of both signals fail
    together there, and what they leave is correlated.  Of a force that repeats but for noise what
    does not repeat must answer to what the position does not repeat: a controller's does, noise of
    a sensor of force, past which the position knows what was commanded, does not.  What is feedback
    after that is asked once more beside the force's own far past.

    Parameters
    ----------
    recording : Recording
        With at least some hundred samples; of a very long one, the middle is used.

    Returns
    -------
    Causality
    """
    signals, joints = _known_then(recording), recording.joints
    first = _causality(*signals, stretches=10, joints=joints)
    if not first.doubt:
        return first
    again = None
    if is_sweep(recording.force):
        again = _causality(*signals, stretches=40, joints=joints)
    elif (found := find_repetition(recording.force)) is not None and found.noisy:
        rest = [_unrepeated(signal, found) for signal in signals]
        again = _causality(rest[0], rest[1], stretches=10)
    milder = again is not None and again.doubt < first.doubt
    if again and milder and not (again.swapped or again.opposite):
        return again
    if first.relay or not first.has_feedback:
        return first
    beside = _causality(*signals, stretches=10, remembered=True, joints=joints)
    return replace(first, far_past=not beside.has_feedback)


def _unrepeated(signal: Floats, found: Repetition) -> Floats:
    """What differs from the mean of the periods, whole periods of it."""
    periods = signal[found.start : found.stop].reshape(-1, found.period)
    return np.asarray((periods - periods.mean(axis=0)).ravel())


def _causality(
    force: Floats,
    position: Floats,
    stretches: int,
    remembered: bool = False,
    joints: tuple[int, ...] = (),
) -> Causality:
    most_samples = 60_000
    start = max(0, (len(force) - most_samples) // 2)
    stop = min(len(force), start + most_samples)
    joints = tuple(joint - start for joint in joints if start < joint < stop)
    force, position = (signal[start:stop] for signal in (force, position))
    at_limits = _at_limits(force)
    saturates = float(np.mean(at_limits))
    repeats = find_repetition(force, _SAME, noise=0.0) is not None
    relay = is_relay(force, position) or (not repeats and is_switched(force, position))
    left_out = at_limits if 0 < saturates < _MOST_AT_LIMIT else None
    of_force = predict(force, position, left_out, stretches, remembered, joints)
    of_position = predict(position, force, stretches=stretches, joints=joints)
    return Causality(
        feedback=tuple(of_force.past(floor) for _, _, floor in _LADDER),
        innovations=innovations_answer(of_force, of_position) if saturates < _MOST_AT_LIMIT else 0,
        answer=of_position.past(_FLOOR),
        same_sample=of_force.same_instant(),
        next_sample=of_force.next_instant(),
        answers=of_force.answers(),
        at_limits=saturates,
        repeats=repeats,
        relay=relay,
        smooth_position=_roughness(position) < _ROUGHER * _roughness(force),
    )


def _known_then(recording: Recording) -> tuple[Floats, Floats]:
    """Force and position as far as each sample tells."""
    sensed = recording.sensed
    if sensed is None or len(sensed.output) != recording.samples:
        return recording.force, recording.position
    return sensed.known_then()


def _at_limits(force: Floats) -> Bools:
    """Samples of a force that saturates where nobody can tell what was wanted; else none."""
    at = [force == limit for limit in (force.min(), force.max())]
    often = any(np.count_nonzero(side) > _FEWEST_AT_LIMIT for side in at)
    fewest_levels = 100
    saturates = often and len(np.unique(force)) > fewest_levels
    return np.asarray((at[0] | at[1]) & saturates)


def _roughness(signal: Floats) -> float:
    """Power of the increments over that of the signal: 2 for white noise."""
    return float(np.var(np.diff(signal)) / np.var(signal))
