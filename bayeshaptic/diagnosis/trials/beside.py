"""Is there another force beside those that were found, or one where nothing linear convinces?

The tests of the residual compare each window with what no smooth response explains, in the motion
without forces: they see little of a drag under friction, or of one that is as smooth over the
frequency as a sweep makes it.  Here the motion is that with the forces, and everything that was
fitted moves along.  Of fourteen free devices with one force none was given another; two held ones
with a gap, of which part stays unexplained, both were given a friction.  Of 52 recordings of
benchmarks/strangers without one, eight of which stay unexplained, none is given one.
"""

from __future__ import annotations

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.battery import is_periodic
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.called_for import is_there
from bayeshaptic.diagnosis.trials.forces.hints import hints
from bayeshaptic.diagnosis.trials.forces.in_pieces import simulated_in
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.laws import BESIDE
from bayeshaptic.effects.library import effects
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, LOAD, MOTOR
from bayeshaptic.effects.nonlinear.protocol import CommandEffect
from bayeshaptic.effects.nonlinear.shapes import (
    ALONG,
    LOAD_VELOCITY,
    POSITION,
    STRETCH,
    STRETCH_VELOCITY,
    VELOCITY,
)

_OVER = {  # by the first of a law's variables, and its place
    (VELOCITY, MOTOR): VELOCITY,
    (VELOCITY, LOAD): LOAD_VELOCITY,
    (VELOCITY, CONNECTION): STRETCH_VELOCITY,
    (POSITION, MOTOR): POSITION,
    (ALONG, MOTOR): ALONG,
    (POSITION, CONNECTION): STRETCH,
    (STRETCH, CONNECTION): STRETCH,
}


def beside_tests(state: State) -> tuple[Test, ...]:
    """One test for each variable that another force may be a function of.

    Of the laws that tests look for, at all their places; not of what is there already.
    """
    recording = simulated_in(state)
    if recording is None or state.etfe.through_reference or is_periodic(state.etfe):
        return ()
    tryout = Tryout(state, recording)
    motion = tryout.simulation.motions(state.fit.theta, (MOTOR, LOAD, CONNECTION))
    looked_for = [
        effect
        for kind in effects("nonlinear")
        if kind.tests and not issubclass(kind, CommandEffect)
        for effect in kind.candidates(state.model, motion)
        if not is_there(effect, state)
    ]
    tests: dict[str, Test] = {}
    for hint in hints(tryout, looked_for):
        over = _OVER[hint.effect.over[0], hint.effect.place]
        text = f"{hint.effect.title} beside it stands {hint.score:.1f} standard deviations out"
        test = Test(over + BESIDE, "nonlinear", hint.score, thresholds.two_sided(), None, text)
        if over not in tests or tests[over].statistic < hint.score:
            tests[over] = test
    return tuple(tests.values())
