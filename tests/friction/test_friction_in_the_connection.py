"""Dry friction between two masses, as the hysteresis of a cable or of a gear."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from on_the_bench import recorded_on

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.residuals.columns import nonlinear_tests
from bayeshaptic.diagnosis.widening.friction import with_friction_for_damping
from bayeshaptic.effects.nonlinear.friction import CoulombFriction, DahlFriction
from bayeshaptic.effects.nonlinear.internal_force import CONNECTION, MOTOR
from bayeshaptic.effects.nonlinear.shapes import LOAD_VELOCITY, STRETCH_VELOCITY, VELOCITY
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.rig import Bench, WhiteNoise
from bayeshaptic.rig.effects.effect import Effect
from benchmarks.recordings.foreign import Hysteresis

LHIFAM = Bench.from_device("lhifam")
TEST = "sign(v - v2)"


def recorded(*effects: Effect, seed: int = 5) -> Recording:
    bench = Bench.from_device("lhifam", effects=effects)
    return recorded_on(bench, WhiteNoise(4.0, 300.0, 0.3, 8.0), seed=seed)


def fitted(recording: Recording) -> Fit:
    return least_squares(build_model("free", "lhifam"), estimate_etfe(recording))


def test_the_residual_shows_it_and_a_clean_device_has_none() -> None:
    scores = []
    for effects in ((Hysteresis(0.4),), ()):
        recording = recorded(*effects)
        tests = {t.name: t for t in nonlinear_tests(fitted(recording), estimate_etfe(recording))}
        scores.append(tests[TEST].statistic / tests[TEST].threshold)
        assert not tests["sign(v)"].flagged
    assert scores[0] > 3 and scores[1] < 0.7


def test_it_is_no_damper_of_the_mode() -> None:
    """Taken for one, with nothing left over, the limit was 1.02 to 1.13 times the truth."""
    force = 0.1
    found = close_loop(recorded(Hysteresis(force)), "free", hidden=False)
    assert found.effect_names == ("coulomb_friction",)
    effect = found.effects[0]
    assert effect.title.endswith("in the connection")
    assert effect.estimates["friction_force"].mean == pytest.approx(force, rel=0.1)
    low, high = found.analysis.limit.quantile(np.array([0.05, 0.95]))
    assert low < LHIFAM.true_critical_stiffness() < high


def test_laws_between_the_masses_are_called_by_what_happens_there() -> None:
    for law in (CoulombFriction, DahlFriction):
        shape = {} if law is CoulombFriction else {"presliding_distance": 1e-6}
        inside, outside = law(CONNECTION, shape), law(MOTOR, shape)
        assert inside.called_for({STRETCH_VELOCITY})
        assert not inside.called_for({VELOCITY, LOAD_VELOCITY})
        assert outside.called_for({VELOCITY}) and not outside.called_for({STRETCH_VELOCITY})


def test_of_the_damping_only_the_connections_may_be_friction() -> None:
    fit = fitted(recorded())
    changed = with_friction_for_damping(fit, dampers=("bc",)) / fit.theta
    others = [name != "bc" for name in fit.model.names]
    assert changed[others] == pytest.approx(1.0) and changed[np.invert(others)] < 0.5


def test_a_damper_of_the_connection_that_is_known_counts_as_well() -> None:
    motion = SimpleNamespace(velocity=np.linspace(-1.0, 1.0, 5))
    law, model = CoulombFriction(CONNECTION), build_model("free", "lhifam")
    known = model.with_known({"bc": model.values[model.names.index("bc")]})
    strengths = [law.first_strengths(one, one.values, motion) for one in (model, known)]
    assert "bc" not in known.names and strengths[1] == pytest.approx(strengths[0])
