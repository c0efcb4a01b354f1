"""Dry friction at the motor, and at the load as well."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.state import Accepted, Change, Estimate
from bayeshaptic.diagnosis.trials.forces.called_for import is_there
from bayeshaptic.effects.nonlinear.friction import CoulombFriction, DahlFriction
from bayeshaptic.effects.nonlinear.internal_force import LOAD, MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.rig import Bench, WhiteNoise, simulate
from bayeshaptic.rig.effects import friction


def test_both_are_found() -> None:
    rms = 3.0
    rubbing = tuple(
        friction.CoulombFriction(part * rms, on) for part, on in ((0.1, "m1"), (0.05, "m2"))
    )
    bench = Bench.from_device("lhifam", effects=rubbing)
    made = simulate(bench, WhiteNoise(rms, 200.0, 0.7, 8.0), seed=3)
    signals = made.force, made.position, bench.period_s
    found = close_loop(recording_from_arrays(*signals), "free", hidden=False)
    assert found.verdict == "explained"
    sizes = {e.title.rsplit(" ", 1)[1]: e.estimates["friction_force"] for e in found.effects}
    assert set(sizes) == {"motor", "load"}
    for place, part in (("motor", 0.1), ("load", 0.05)):
        # Two standard deviations of chance, and what a law may leave.
        assert sizes[place].mean == pytest.approx(
            part * rms, abs=2 * sizes[place].sd + 0.05 * rms * part
        )
    # With one law alone the limit was 1.08 times the truth.
    median = float(found.analysis.limit.quantile(np.array(0.5)))
    assert median == pytest.approx(bench.true_critical_stiffness(), rel=0.05)


def test_a_mass_has_one_friction_and_another_mass_may_rub() -> None:
    change, size = Change(acting=Acting(CoulombFriction(MOTOR), 0.3)), Estimate(0.3, 0.01, "N")
    found = {"friction_force": size}
    rubs = Accepted("coulomb_friction", "", "nonlinear", "", found, change=change)
    state: Any = SimpleNamespace(accepted=(rubs,))
    assert is_there(CoulombFriction(MOTOR), state) and is_there(DahlFriction(MOTOR), state)
    assert not is_there(CoulombFriction(LOAD), state)
