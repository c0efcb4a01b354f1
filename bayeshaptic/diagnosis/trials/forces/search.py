"""Searching for a force: a coarse scan of strengths of every variant, and fits of the best."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial

import numpy as np

from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.hints import PARTS, STANDS_OUT, Hint, departures, hints
from bayeshaptic.diagnosis.trials.forces.nested import fit_nested
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.nonlinear.internal_force import Place
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect, Motion, NonlinearEffect
from bayeshaptic.models.structures import GROUND_DAMPERS
from bayeshaptic.numerics.spending import Meter
from bayeshaptic.types import Floats

Variants = list[NonlinearEffect]  # of one effect
FIT_OF = ", its fit"  # behind a law's title: what was not tried of it

_CLEARLY = 6.0  # standard deviations, where first order promises 18: see `_followed`
_IN_REACH = 0.5  # of the largest score: the rest is worth less than a quarter of the best
_HOPELESS = 0.3  # share of the best gain so far below which a force is not followed up
_NEAR = np.array([0.8, 1.0])


def worth_following(point: Point, found: Iterable[Point]) -> bool:
    """Whether a force gains no less than a share of what the best of those found gains."""
    best = max((other.gain_fit for other in found), default=0.0)
    return point.gain_fit > _HOPELESS * best


def fitted(
    tryout: Tryout, points: list[Point], meter: Meter, before: Sequence[Point] = ()
) -> list[Point]:
    """The points fitted, the most promising first; the hopeless as they are, the faint left out."""
    found = list(before)
    faint = 10.0  # gain below which nothing is tried
    for point in sorted(points, key=lambda point: -point.gain_fit):
        if point.gain_fit < faint:
            continue
        worth = worth_following(point, found)
        follow = worth and meter.affords(f"{point.effect.title}{FIT_OF}")
        found.append(fit_force(tryout, point) if follow else point)
    # The linear parameters were fitted once more after the motion was simulated.
    return [one for one in found if tryout.stays(one)]


def to_scan(
    tryout: Tryout, laws: Sequence[Variants], known: Mapping[str, Point], meter: Meter
) -> list[Variants]:
    """Laws of known forces, and of others what stands out to first order, within reach of its best.

    What acts on the command stays as it is, and so does what runs away: no score is known of these.
    Beside forces that a state has nothing is left out: first order is all that is asked there.
    """
    if tryout.before:
        return list(laws)
    own = [law for law in laws if law[0].strength[0] in known]
    new = [law for law in laws if law[0].strength[0] not in known and meter.affords(law[0].title)]
    scored = [effect for law in new for effect in law if not isinstance(effect, CommandEffect)]
    scores = {id(hint.effect): hint.score for hint in hints(tryout, scored)} if scored else {}

    def standing_out(law: Variants) -> Variants:
        least = max(STANDS_OUT, _IN_REACH * max(scores.get(id(e), 0.0) for e in law))
        return [effect for effect in law if scores.get(id(effect), np.inf) >= least]

    return own + [kept for law in new if (kept := standing_out(law))]


def search(
    tryout: Tryout,
    variants: Variants,
    motion: dict[Place, Motion],
    meter: Meter,
    known: Point | None = None,
) -> Point:
    """The best variant on a coarse scan of strengths, or beside that of a known force."""
    meter.trying(variants[0].title)
    theta = tryout.state.fit.theta
    points: list[Point] = []
    for effect in variants:
        if known:
            before, near = known.forces[:-1], _NEAR * known.strength
            scan = partial(_scan, tryout, before, effect, near, expected=known.motion)
            beside = scan(known.theta)
            if not any(np.isfinite(point.gain_fit) for point in beside):
                beside = scan(_damped(tryout, known.theta))
            points += beside
            continue
        firsts = effect.first_strengths(tryout.model, theta, motion[effect.place])
        for strengths in (firsts, -firsts) if effect.signed else (firsts,):
            points += _scan(tryout, tryout.before, effect, strengths, theta, tryout.known_motion, 8)
    return max(points, key=lambda point: point.gain_fit)


def beside_others(
    tryout: Tryout,
    laws: Sequence[Variants],
    meter: Meter,
    least: float = 0.0,
) -> list[Point]:
    """The best variant of each law beside the forces that the state has, where it stands out.

    By the `least` of standard deviations that is given, too.

    A scan would be lost there in how roughly a motion that sticks goes with the linear parameters:
    where a force was worth 263 in log likelihood, the best of five strengths had -9.
    """
    theta = tryout.state.fit.theta

    def start(hint: Hint, part: float) -> Point:
        force = Acting(hint.effect, part * hint.strength)
        return tryout.point((*tryout.before, force), theta, expected=tryout.known_motion)

    every = [
        h for h in hints(tryout, [effect for law in laws for effect in law]) if h.score >= least
    ]
    nothing = tryout.point(tryout.before, theta, expected=tryout.known_motion) if every else None
    return _followed(tryout, every, start, nothing, laws, fit_nested, meter)


def containing(
    tryout: Tryout,
    known: Point,
    laws: Sequence[Variants],
    meter: Meter,
) -> list[Point]:
    """The best variant of each law that contains that of a known force, where it stands out.

    From the known one's fit on.  In four recordings with Coulomb's friction none of three further
    laws stood out by more than 3.2; in four with Stribeck's that one did, by 18 to 77.
    """
    laws = [law for law in laws if law and meter.affords(law[0].title)]
    if not laws:
        return []
    *before, own = known.forces

    def start(hint: Hint, part: float) -> Point:
        law = hint.effect.departing(min(part * hint.strength, 1.0))
        return tryout.point(
            (*before, Acting(law, own.strength)), known.theta, expected=known.motion
        )

    every = departures(tryout, known, [effect for law in laws for effect in law])
    return _followed(tryout, every, start, known, laws, fit_force, meter)


def _followed(
    tryout: Tryout,
    every: Sequence[Hint],
    start: Callable[[Hint, float], Point],
    nothing: Point | None,
    laws: Sequence[Variants],
    fit: Callable[[Tryout, Point], Point],
    meter: Meter,
) -> list[Point]:
    """The best hint of each law fitted, where it stands out, from the best part of what it says.

    One that stands out by little only where some part of it is better than `nothing` of it: beside
    a gap four that were not took 6 s and ended worse; of 12 others nine gained.
    """
    found = []
    most = max((hint.score for hint in every), default=0.0)
    for law in laws:
        own = [hint for hint in every if any(hint.effect is effect for effect in law)]
        best = max(own, key=lambda hint: hint.score, default=None)
        if best is None or best.score < max(STANDS_OUT, _IN_REACH * most):
            continue
        meter.trying(best.effect.title)
        point = max((start(best, part) for part in PARTS), key=lambda point: point.gain_fit)
        least = -np.inf if nothing is None or best.score > _CLEARLY else nothing.gain_fit
        if point.gain_fit > least and meter.affords(best.effect.title):
            found.append(fit(tryout, point))
    return [one for one in found if tryout.stays(one)]


def _damped(tryout: Tryout, theta: Floats) -> Floats:
    """Linear parameters beside a force that may have taken all damping: any other runs away there.

    A fifth of what the ground dampers are without a force.
    """
    share, without = 0.2, tryout.state.fit.theta
    ground = np.isin(tryout.model.names, GROUND_DAMPERS)
    return np.where(ground, np.maximum(theta, share * without), theta)


def _scan(
    tryout: Tryout,
    before: tuple[Acting, ...],
    effect: NonlinearEffect,
    strengths: Floats,
    theta: Floats,
    expected: Floats | None = None,
    beyond: int = 0,
) -> list[Point]:
    """From faint to strong beside the forces before it, until it is clearly too strong.

    Where the strongest is still the best, up to `beyond` more, each three times as strong: friction
    that the linear model took for a damper leaves a motion from which it looks faint.  And where
    the faintest is too strong already, as many that are ever fainter.
    """
    # The less an actuator's limit, the stronger it acts.
    stronger = 3.0 if abs(strengths[-1]) > abs(strengths[0]) else 1 / 3.0

    def point(strength: float, start: Floats, near: Floats | None) -> Point:
        return tryout.point((*before, Acting(effect, strength)), start, expected=near)

    points: list[Point] = []
    too_strong = 10.0  # drop of the log likelihood at which a scan stops
    further = strengths[-1] * stronger ** np.arange(1, beyond + 1)
    for number, strength in enumerate([*strengths, *further]):
        start, near = (points[-1].theta, points[-1].motion) if points else (theta, expected)
        points.append(point(float(strength), start, near))
        gained = points[-1].gain_fit - points[-2].gain_fit if len(points) > 1 else np.inf
        if gained < -too_strong or (number >= len(strengths) - 1 and not gained > 0):
            break
    return points + _fainter(point, points[0], theta, 1 / stronger, beyond)


def _fainter(
    at: Callable[[float, Floats, Floats | None], Point],
    first: Point,
    theta: Floats,
    factor: float,
    most: int,
) -> list[Point]:
    """Where the faintest of a scan is too strong already: ever fainter, until less is no better.

    Tests see forces that are a hundredth of what a scan begins with.  `factor` is that on a
    strength to make it act less.
    """
    points = [first]
    no_trace = 1.0  # of the log likelihood: a force that gains 10 at its best gains more a step
    while first.gain_fit < 0 and len(points) <= most:
        points.append(at(factor * points[-1].strength, theta, points[-1].motion))
        if not points[-1].gain_fit - points[-2].gain_fit > no_trace:
            break
    return points[1:]
