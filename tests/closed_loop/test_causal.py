"""Tests of causal changes in a loop: the encoder's rounding is none, and a wrong model is one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bayeshaptic.diagnosis.residuals import causal, residual
from bayeshaptic.diagnosis.residuals.causal import causal_tests
from bayeshaptic.diagnosis.state import State
from bayeshaptic.diagnosis.trials.forces.tryout import Tryout
from bayeshaptic.effects.nonlinear.friction import CoulombFriction
from bayeshaptic.effects.nonlinear.internal_force import MOTOR
from bayeshaptic.effects.nonlinear.protocol import Acting
from bayeshaptic.inference.fit import Fit, summarise
from bayeshaptic.inference.least_squares import least_squares, polish
from bayeshaptic.models import build_model
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from bayeshaptic.recordings.response.estimators.noise_slope import noise_slopes
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.types import Floats
from benchmarks.strangers import loops
from benchmarks.through_reference import Case, make

TIME = "time-varying"
# Held PHANToMs, whose counts are coarse, of 5 to 19 s.
COARSE = (446, 576, 614, 706)


def test_scores_are_sums_over_windows_and_nodes() -> None:
    rng = np.random.default_rng(3)

    def drawn(*shape: int):
        return rng.normal(size=shape) + 1j * rng.normal(size=shape)

    nodes, design, changes = rng.uniform(1, 9, (20, 3)), drawn(20, 3, 4), drawn(20, 3, 5)
    windows = Windows(nodes, design, drawn(20, 3), rng.uniform(1, 2, 20), np.full(20, 9.0))
    found = causal.scores(SimpleNamespace(response=lambda at: 1 / at), windows, changes)
    score, information = np.zeros(6), np.zeros((6, 6))
    for window in range(20):
        own = design[window, :, :3]
        left = windows.target[window] - own @ (1 / nodes[window])
        moved = np.hstack([own @ changes[window], design[window, :, 3:]])
        power = windows.scatter[window] + np.linalg.norm(left) ** 2
        along = moved.conj().T @ left
        score += 16 / power * along.real
        information += 16 / power * (moved.conj().T @ moved).real
        information -= 16 / power**2 * np.outer(along, along.conj()).real
    np.testing.assert_allclose(found.score * found.size, score, rtol=1e-10)
    sizes = np.outer(found.size, found.size)
    np.testing.assert_allclose(found.covariance * sizes, information, rtol=1e-10, atol=1e-9)


def right(case: Case) -> tuple[Fit, Etfe]:
    """The right model, fitted from the true parameters."""
    held = "held" in case.what
    device = "phantom" if "phantom" in case.what else "lhifam"
    model = build_model("grasped" if held else "free", device, delay_s=case.bench.delay_s)
    etfe = estimate_by_direct_method(replace(case.recording, reference=None))
    truth = {**case.bench.values, "delay_s": case.bench.delay_s}
    theta = np.array([truth[name] for name in model.names])
    for _ in range(2):
        windows = compress(etfe, lambda f, at=theta: model.response(at, f))
        theta = polish(model, windows, theta)
    return summarise(model, compress(etfe, lambda f: model.response(theta, f)), theta), etfe


def rubbing(case: Case) -> tuple[Fit, Etfe, Floats]:
    """The right model beside the friction that acted, and what that adds to the motion."""
    fit, etfe = right(case)
    assert etfe.unbroken is not None
    friction = (Acting(CoulombFriction(MOTOR), case.friction * case.bench.force_rms),)
    tryout = Tryout(State(etfe, fit), etfe.unbroken)
    point = tryout.point(friction, fit.theta, rounds=3)
    assert point.motion is not None
    return summarise(fit.model, point.windows, point.theta), point.etfe, point.motion


def change(tests: tuple[residual.Test, ...]) -> residual.Test:
    (found,) = (test for test in tests if test.name == "causal change")
    return found


@pytest.mark.parametrize("seed", COARSE)
def test_rounding_is_no_causal_change(seed: int) -> None:
    """Of scores beside the measured position alone every one of these is flagged."""
    fit, etfe = right(make(seed))
    assert change(causal._tests(fit, etfe)).flagged
    assert not change(causal_tests(fit, etfe)).flagged


@pytest.mark.parametrize("seed", COARSE)
def test_a_hand_that_a_model_lacks_is_a_causal_change_there(seed: int) -> None:
    etfe = estimate_by_direct_method(replace(make(seed).recording, reference=None))
    fit = least_squares(build_model("free", "phantom"), etfe)
    assert change(causal_tests(fit, etfe)).excess > 3


def test_the_rounding_of_a_motion_with_forces_in_it_is_that_of_all_of_it() -> None:
    fit, etfe, motion = rubbing(make(4083))  # a held PHANToM
    assert change(causal_tests(fit, etfe)).flagged, "of a motion that nobody measured"
    assert not change(causal_tests(fit, etfe, motion)).flagged


def test_noise_that_falls_steeply_where_the_controller_answers_to_it() -> None:
    """A held LHIfAM that rubs: one window, around 0.9 Hz, has a score of eight by itself."""
    fit, etfe, motion = rubbing(make(4049))
    assert change(causal._tests(fit, etfe)).flagged
    assert not change(causal_tests(fit, etfe, motion)).flagged


def test_how_steeply_noise_falls_is_what_the_right_model_leaves() -> None:
    """Of a motion whose controller answers to nearly all of it, a window's own response is that."""
    rng = np.random.default_rng(3)
    lines, window = 960, 24
    frequency = 0.1 * (1 + np.arange(lines))
    white = (rng.standard_normal((2, lines)) + 1j * rng.standard_normal((2, lines))) / np.sqrt(2)
    falls = 6.0
    noise = frequency ** (-falls / 2) * white[0]
    device, controller = -1 / frequency**2, 30.0 + 0.0j
    followed = 1e-3 * frequency[0] ** (-falls / 2) * white[1]
    position = (device * followed + noise) / (1 + device * controller)
    force = followed - controller * position
    spectra = RandomSpectra(
        frequency,
        force,
        position,
        np.arange(0, lines + 1, window),
        np.zeros(lines // window),
        lambda f: -1 / np.asarray(f) ** 2,
    )
    wide = 2  # windows, of which each says its slope within some two
    known = noise_slopes(spectra, position - device * force)[:wide]
    assert np.abs(known.mean() - falls) < 1.5
    assert np.abs(noise_slopes(spectra)[:wide].mean() - falls) > 3


def test_a_position_that_nothing_rounds_is_looked_at_as_it_is() -> None:
    recording = make(408).recording
    rng = np.random.default_rng(1)
    position = recording.position + 1e-9 * rng.standard_normal(recording.samples)
    etfe = estimate_by_direct_method(replace(recording, position=position, reference=None))
    fit = least_squares(build_model("free", "phantom"), etfe)
    _, closer = causal._closer(fit, etfe, 0.0)
    assert np.array_equal(closer.spectra.position, etfe.spectra.position)  # type: ignore[attr-defined]


def test_a_damping_that_fades_is_a_change_in_time() -> None:
    """From 1.9 to 1.4 times what it ends at, in a loop of 7 s, and the gain stays what it is."""
    case = loops.make(95018)
    assert case is not None and set(case.effects) == {"stribeck", "warming up"}
    etfe = estimate_by_direct_method(case.recording)
    fit = least_squares(build_model("free", "phantom", delay_s=case.told["delay_s"]), etfe)
    found = {test.name: test for test in causal_tests(fit, etfe)}
    assert found["a steady change"].excess > 3 and found["a steady change"].family == "time-varying"
    assert not found["a change and back"].flagged


def test_a_device_that_stays_as_it_is_does_not_change_in_time() -> None:
    """Of 120 such loops that follow noise or steps one is past five, which is not among these."""
    found = []
    for seed in range(400, 460, 6):  # that follow noise or steps
        case = make(seed)
        if ", ramps," not in case.what:
            fit, etfe = right(case)
            found += [test.statistic for test in causal_tests(fit, etfe) if test.family == TIME]
    assert len(found) >= 10 and max(found) < 5
