"""What a little of a force would do: the same as a simulation with that little says."""

from __future__ import annotations

import numpy as np
import pytest
from on_the_bench import recorded_on, usual_noise

import bayeshaptic as bh
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.hints import STANDS_OUT, hints
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting, NonlinearEffect
from bayeshaptic.effects.nonlinear.springs import Backlash, HardeningSpring
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.rig import Bench

EFFECTS: dict[str, NonlinearEffect] = {
    "hardening_connection": HardeningSpring(CONNECTION),
    "backlash": Backlash(CONNECTION, {"damping_in_gap": 0.9}),
    "coulomb_friction": CoulombFriction(MOTOR),
}


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
@pytest.mark.parametrize("name", EFFECTS)
def test_first_order_is_what_a_little_of_the_force_does(name: str, device: str) -> None:
    """Of a cubic spring a unit, a newton to the cubed metre, moves nothing that is a number."""
    rig = Bench.from_device(device, held=False).with_effect(name)
    recording = recorded_on(rig, usual_noise(rig, 10.0), seed=3)
    etfe = bh.estimate_etfe(recording)
    fit = bh.least_squares(bh.free(device=device), etfe)
    tryout = Tryout(State(etfe, fit), recording)
    effect = EFFECTS[name]
    (hint,) = hints(tryout, [effect])
    motion = tryout.simulation.motions(fit.theta, (effect.place,))[effect.place]
    little = 0.01 * float(effect.first_strengths(fit.model, fit.theta, motion)[0])
    # At the optimum the likelihood's slope is that with the linear parameters as they are.
    with_it = tryout.as_it_is((Acting(effect, little),), fit.theta)
    without = tryout.as_it_is((), fit.theta)
    gain = sum(
        sign * float(np.sum(Likelihood(fit.model, one.windows).pointwise(fit.theta[None])))
        for one, sign in ((with_it, 1.0), (without, -1.0))
    )
    assert hint.score > STANDS_OUT
    promised = hint.score**2 / hint.strength * little
    assert promised == pytest.approx(gain, rel=0.05)
