"""What the forces that tests still see in a loop do to the limit and to the parameters."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from fake_analysis import fake_closed
from test_direct import loop

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.residuals import residual
from bayeshaptic.diagnosis.residuals.causal import causal_tests
from bayeshaptic.diagnosis.residuals.columns import columns
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import ForceSeen
from bayeshaptic.diagnosis.widening.discrepancy import with_discrepancy
from bayeshaptic.diagnosis.widening.forces_left import forces_left
from bayeshaptic.diagnosis.widening.law_error import with_law_error
from bayeshaptic.inference.coordinates import coordinates
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import polish
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import critical_stiffness


def seen(strength: float, moves: tuple[float, ...], name: str = "v^3") -> residual.Test:
    force = ForceSeen(strength, 0.1, 1.0, moves)
    return residual.Test(name, "nonlinear", 2.0, 4.4, None, "", force)


def along(fit: Fit, **moved: float) -> tuple[float, ...]:
    return tuple(moved.get(name, 0.0) for name in fit.model.names)


def limit_log(fit: Fit, theta: np.ndarray) -> float:
    return float(np.log(critical_stiffness(fit.model, theta).value))


def test_what_a_force_moves_is_what_a_fit_with_it_moves() -> None:
    bench, _, recording = loop(8)
    state = close_loop(recording, "free", hidden=False, delay_s=bench.delay_s).traced.state
    fit, etfe = state.fit, state.etfe
    name = "v^3"
    (test,) = (one for one in causal_tests(fit, etfe) if one.name == name)
    assert test.force is not None and len(test.force.moves) == fit.model.size
    every = columns(fit, recording, Lines.of(etfe, recording), in_loop=True)
    added = next(motions for shape, motions, _ in every if shape == name)[0]
    # As strong as the noise leaves it open, so that the first order holds.
    strength = 0.5 * test.force.sd
    there = replace(etfe.spectra, position=etfe.spectra.position - strength * added)  # type: ignore[type-var,attr-defined]
    before, after = (
        polish(fit.model, one.windows(fit.response), fit.theta) for one in (etfe.spectra, there)
    )
    here = coordinates(fit.model)
    found = here.coordinate(after[None])[0] - here.coordinate(before[None])[0]
    said = strength * np.array(test.force.moves)
    size = np.linalg.norm(found)
    assert found @ said / (size * np.linalg.norm(said)) > 0.99
    # What of a motion goes with the noise tells a fit something, and a score nothing.
    assert 1.0 <= np.linalg.norm(said) / size < 1.4


def test_the_worst_of_the_forces_that_are_seen_counts() -> None:
    fit = fake_closed("explained", "nonlinear").analysis.fit
    here = coordinates(fit.model)
    step = 1e-3
    tests = (
        seen(0.1, along(fit, m1=step)),
        seen(-1.0, along(fit, m2=step), "x^3"),
        residual.Test("bands", "linear", 90.0, 4.5, None, ""),
        residual.Test("sign(v)", "nonlinear", 9.0, 4.5, None, "", ForceSeen(9.0, 1.0, 1.0)),
    )
    far = {}
    for name, change in (("m1", 0.1 * step), ("m2", -step)):
        phi = here.coordinate(fit.theta[None]) + np.array(along(fit, **{name: change}))
        far[name] = abs(limit_log(fit, here.natural(phi)[0]) - limit_log(fit, fit.theta))
    found = forces_left(fit, tests)
    assert found.limit_log == pytest.approx(max(far.values()), rel=0.01)
    worst = max(far, key=lambda name: far[name])
    assert fit.model.names[int(np.argmax(np.abs(found.parameters / fit.theta)))] == worst


def test_a_damper_that_is_next_to_nothing_has_a_slope_to_one_side(monkeypatch) -> None:
    """On the other there is no device: a limit of nothing, whose logarithm is any number."""
    fit = fake_closed("explained", "nonlinear").analysis.fit
    place = fit.model.names.index("b2")
    fit = replace(fit, theta=np.where(np.arange(fit.model.size) == place, 0.0, fit.theta))
    asked = []

    def limits(model, theta):
        asked.append(theta)
        return SimpleNamespace(
            samples=np.where(np.all(theta >= 0, axis=1), 1.0 + theta[:, place], 0)
        )

    monkeypatch.setattr("bayeshaptic.diagnosis.widening.forces_left.critical_stiffness", limits)
    strength = 1e-3
    found = forces_left(fit, (seen(strength, along(fit, b2=1.0)),))
    assert np.all(asked[0] >= 0)
    # Of log(1 + b2), b2 as long as its coordinate is where that is linear.
    scale = float(coordinates(fit.model).scale[place])
    assert found.limit_log == pytest.approx(strength * scale, rel=1e-2)


def test_where_no_test_says_what_a_force_moves_none_is_left() -> None:
    fit = fake_closed("explained", "nonlinear").analysis.fit
    found = forces_left(fit, (residual.Test("bands", "linear", 90.0, 4.5, None, ""),))
    assert found.limit_log == 0.0 and not found.parameters.any()


def test_a_force_seen_faintly_in_a_loop_widens_by_what_it_does(monkeypatch) -> None:
    """A limit that friction had moved by 14 dB was 12 dB wide, because tests see noise."""
    closed = fake_closed("explained", "nonlinear")
    one, fit = closed.analysis, closed.analysis.fit
    base = replace(fit, theta=np.where(np.array(fit.model.names) == "b1", 4.0, 1.0) * fit.theta)
    effects = tuple(replace(e, limit_log_sd=0.0) for e in closed.traced.state.accepted)
    traced = replace(
        closed.traced,
        state=replace(closed.traced.state, accepted=effects),
        before=(seen(4.0, (), "sign(v)"),),
        after=(seen(0.1, along(fit, m2=0.2)),),
    )
    monkeypatch.setattr(Etfe, "direct", True)
    wide = with_discrepancy(one.limit, one.posterior, base, traced)
    ratio = np.log(wide.samples / one.limit.samples)
    width = forces_left(fit, traced.after).limit_log
    assert width > 1e-4
    assert np.quantile(ratio, [0.05, 0.95]) == pytest.approx([-0.9 * width, 0.9 * width], rel=0.05)
    posterior = with_law_error(one.posterior, fit, traced)
    assert posterior is not None
    place = one.posterior.names.index("m2")
    moved = posterior.chains[..., place] / one.posterior.chains[..., place] - 1
    assert np.abs(moved).max() == pytest.approx(0.1 * 0.2, rel=0.1)
    others = np.delete(posterior.chains - one.posterior.chains, place, axis=-1)
    assert np.allclose(others, 0.0)
