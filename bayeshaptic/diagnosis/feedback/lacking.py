"""What the motion of one mass in its loop lacks: laws that join it, and what speaks against it.

Tones that stand out of what the fit leaves are fitted with it first, because they hide other things
and look like them.  Then every force of a table is tested by its score in what is left.  Forces
over the velocity are laws of one mass, and join it.  Damping that fades with the frequency (a base
that gives, a connection that relaxes, eddy currents) and whatever changes with time are not: they
say that a limit from one mass would be another device's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.feedback.candidate_laws import CandidateLaw, candidate_laws
from bayeshaptic.diagnosis.feedback.inverse_dynamics import inverse_dynamics
from bayeshaptic.diagnosis.feedback.refit import Refit, is_worth_it
from bayeshaptic.diagnosis.feedback.smooth_motion import smooth_pieces
from bayeshaptic.diagnosis.feedback.tones_in_motion import with_tones
from bayeshaptic.diagnosis.feedback.unlike_one_mass import unlike_one_mass
from bayeshaptic.effects.nonlinear.drag import Drag
from bayeshaptic.effects.nonlinear.friction import DahlFriction, RisingFriction, StribeckFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import NonlinearEffect
from bayeshaptic.effects.nonlinear.shapes import Usual
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.mass_forces import COULOMB, MassForces
from bayeshaptic.inference.time_domain.mass_in_loop import DELAY, DRY
from bayeshaptic.inference.time_domain.scores import Score, scores
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.recording import Recording

# Student's t of eight degrees of freedom: 1 in 1,000 for each of some twenty forces.  With what
# `is_worth_it` asks, a law joins in 5 of 200 loops with a force along the way that is no law,
# something speaks against a limit in 6 (benchmarks/closed_loop.py); neither in any of 20 clean ones
# of benchmarks/strangers.
_SEEN = 5.04
_ROUNDS = 2  # another law of dry friction, and a resistance
_DRY_LAWS = (StribeckFriction.name, RisingFriction.name, DahlFriction.name)


@dataclass(frozen=True)
class Lacking:
    """A law that one mass in its loop lacks.

    Attributes
    ----------
    effect : NonlinearEffect
    score : Score
        Of its force before it joined.
    estimates : mapping
        Its numbers beside dry friction: name to mean and standard deviation.
    """

    effect: NonlinearEffect
    score: Score
    estimates: Mapping[str, tuple[float, float]]


def with_laws(
    recording: Recording, follower: Follower | None
) -> tuple[MotionFit, tuple[Lacking, ...], tuple[str, ...]]:
    """The motion fitted with the laws that it lacks; these laws; and what speaks against all of it.

    Parameters
    ----------
    recording : Recording
    follower : Follower or None

    Raises
    ------
    InputError
        Where no motion of one mass can be found beside the measured one.
    """
    path = smooth_pieces(recording)
    usual = Usual.of(path.velocity, path.position, recording.position_unit)
    refit = Refit(recording, follower)
    motion = with_tones(fit_motion(recording, follower), refit)
    seen: dict[str, Score] = {}
    further = _with_drag(motion, refit)
    for _ in range(_ROUNDS):
        asked = [c for c in candidate_laws(recording, path, usual) if c.name not in seen]
        if motion.forces.friction.name != COULOMB.friction.name:
            asked = [c for c in asked if c.name not in _DRY_LAWS]
        better = further + [
            (more, candidate.name, score)
            for candidate, score in _best_of_each(motion, recording, asked)
            if (more := _with_law(motion, candidate, score, refit)) is not None
        ]
        if not better:
            break
        motion, name, seen[name] = min(better, key=lambda one: one[0].error_rms)
        further = []
    return motion, _found(motion, seen), _speaks_against(motion, recording)


def _with_drag(alone: MotionFit, refit: Refit) -> list[tuple[MotionFit, str, Score]]:
    """A fit that begins with drag, where the inverse dynamics see it: its score alone would not."""
    name = "drag_2"
    try:
        found = inverse_dynamics(unbroken(refit.recording), terms=("coulomb", name))
    except InputError:
        return []
    strength, sd = found[name]
    clear = 3.0  # standard deviations
    if not strength > clear * sd:
        return []
    mass, damping, offset, dry = (found[n][0] for n in ("mass", "damping", "offset", "coulomb"))
    start = np.array([mass, max(damping, 0.01 * mass), max(dry, 0.0), offset, alone.inside[DELAY]])
    start[DELAY] = min(start[DELAY], refit.recording.period_s)
    dragged = MassForces(others=(Drag(MOTOR),), strengths=(strength,))
    more = refit.with_more(alone, start, dragged)
    if more is None:
        return []
    return [(more, Drag.name, Score(strength, sd, (more.error_rms / alone.error_rms) ** 2))]


def _with_law(
    motion: MotionFit, candidate: CandidateLaw, score: Score, refit: Refit
) -> MotionFit | None:
    """Fitted again with a law; None where that does not do what its score promised."""
    acting, dry = motion.forces.at(motion.numbers), float(motion.inside[DRY])
    forces = candidate.joined(acting, dry, score.strength)
    more = refit.with_more(motion, motion.inside, forces)
    if more is None:
        return None
    rubs = more.inside[DRY] > np.sqrt(more.covariance[DRY, DRY])
    return more if rubs or candidate.name not in _DRY_LAWS else None


def _found(motion: MotionFit, seen: Mapping[str, Score]) -> tuple[Lacking, ...]:
    estimates: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in seen}
    numbers = zip(motion.forces.names, motion.numbers, motion.number_sd, strict=True)
    for (effect, name), value, sd in numbers:
        estimates[effect.name][name] = float(value), float(sd)
    acting = {effect.name: effect for effect in (motion.forces.friction, *motion.forces.others)}
    return tuple(Lacking(acting[name], score, estimates[name]) for name, score in seen.items())


def _best_of_each(
    motion: MotionFit, recording: Recording, asked: Sequence[CandidateLaw]
) -> list[tuple[CandidateLaw, Score]]:
    """Of each law that is seen and makes sense the candidate that leaves least."""
    scored = scores(motion, recording, [one.force for one in asked])
    found: dict[str, tuple[CandidateLaw, Score]] = {}
    for one, score in zip(asked, scored, strict=True):
        if score is None or score.t < _SEEN or not is_worth_it(score.left):
            continue
        if one.name not in found or score.left < found[one.name][1].left:
            found[one.name] = one, score
    return list(found.values())


def _speaks_against(motion: MotionFit, recording: Recording) -> tuple[str, ...]:
    """Forces that are seen and that no limit of one mass goes with."""
    asked = list(unlike_one_mass(recording, motion.velocity(recording)))
    scored = scores(motion, recording, [force for _, force in asked])
    seen = [
        (score.left, f"{why} (t = {abs(score.t):.3g})")
        for (why, _), score in zip(asked, scored, strict=True)
        if score is not None and abs(score.t) > _SEEN and is_worth_it(score.left)
    ]
    return (min(seen)[1],) if seen else ()
