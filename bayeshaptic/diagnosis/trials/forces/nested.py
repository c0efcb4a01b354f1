"""Laws that contain a simpler one, beside a further force: from the simplest law on.

Found alone a larger law takes what it can of what else acts: friction that falls from a bump at
rest, of static values up to thirty times the kinetic one, stood in for dry friction with a drag.
The fit of both then has a long way back along a ridge, and other forces seem to be missing.
"""

from __future__ import annotations

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.trials.forces.fit import fit_force
from bayeshaptic.diagnosis.trials.forces.hints import PARTS, STANDS_OUT, departures
from bayeshaptic.diagnosis.trials.forces.tryout import Point, Tryout
from bayeshaptic.effects.laws import simplest
from bayeshaptic.effects.nonlinear.protocol import Acting

_STRENGTHS = 1.0, 1.5, 2.2, 3.3  # of the simple law over the larger one's, which adds to that


def fit_nested(tryout: Tryout, start: Point) -> Point:
    """The best forces near `start`, the earlier ones by no larger laws than they need.

    Parameters
    ----------
    tryout : Tryout
    start : Point
        Of the forces before, and one more.

    Returns
    -------
    Point
        With the larger law where it is worth its numbers on windows that took no part.
    """
    index = next((i for i, one in enumerate(start.forces[:-1]) if simplest(one.effect)), None)
    if index is None:
        return fit_force(tryout, start)
    larger = start.forces[index].effect
    plain = fit_force(tryout, _with_the_simplest(tryout, start, index))
    hints = [] if plain.motion is None else departures(tryout, plain, [larger], index)
    if not hints:  # it runs away
        return fit_force(tryout, start)
    if hints[0].score < STANDS_OUT:
        return plain
    strength, way = plain.forces[index].strength, hints[0].strength
    laws = [larger.departing(min(part * way, 1.0)) for part in PARTS]
    full = fit_force(
        tryout, _likeliest(tryout, plain, index, [Acting(law, strength) for law in laws])
    )
    worth = thresholds.A_PARAMETER * len(larger.tuned)
    return full if full.gain_choose - plain.gain_choose > worth else plain


def _with_the_simplest(tryout: Tryout, start: Point, index: int) -> Point:
    """With a simple law in the place of the larger one, of the strength that fits best."""
    own = start.forces[index]
    law = simplest(own.effect)
    assert law
    forces = [Acting(law, factor * own.strength) for factor in _STRENGTHS]
    return _likeliest(tryout, start, index, forces)


def _likeliest(tryout: Tryout, known: Point, index: int, instead: list[Acting]) -> Point:
    """The point whose force number `index` is replaced by whichever of `instead` fits best."""
    before, after = known.forces[:index], known.forces[index + 1 :]
    points = [
        tryout.point((*before, one, *after), known.theta, expected=known.motion) for one in instead
    ]
    return max(points, key=lambda point: point.gain_fit)
