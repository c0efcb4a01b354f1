"""Closed loops whose leakage is the device's own free motion."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from bayeshaptic.diagnosis.base.free_motion import by_free_motion, leaks_more
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.around_fit import draws_around
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import free
from bayeshaptic.models.build import with_unknown_delay
from bayeshaptic.models.structures import structure_named
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from bayeshaptic.recordings.response.estimators.direct import free_motions
from bayeshaptic.stability.critical import critical_stiffness
from benchmarks.bounds.two_masses import bound_db
from benchmarks.through_reference import make

STEPS = 32  # a free LHIfAM under PI that follows steps, without friction
VALUES = {"m1": 0.2, "b1": 0.3, "bc": 4.0, "kc": 900.0, "m2": 1.5, "b2": 2.0}
PERIOD_S, DELAY_S = 1e-3, 1.4e-3


def fitted(recording):
    etfe = estimate_by_direct_method(replace(recording, reference=None))
    model = with_unknown_delay(free(period_s=recording.period_s))
    return State(etfe, least_squares(model, etfe))


@pytest.fixture(scope="module")
def state():
    return by_free_motion(fitted(make(STEPS).recording))


def positions(force, start, samples):
    """Of the device from any state; `force` begins two periods before the first sample."""
    m1, b1, bc, kc, m2, b2 = VALUES.values()
    motion = np.zeros((5, 5))
    motion[0, 1] = motion[2, 3] = 1.0
    motion[1] = [-kc / m1, -(b1 + bc) / m1, kc / m1, bc / m1, 1 / m1]
    motion[3] = [kc / m2, bc / m2, -kc / m2, -(b2 + bc) / m2, 0.0]
    late = DELAY_S % PERIOD_S
    early, rest = expm(motion * late), expm(motion * (PERIOD_S - late))
    state, found = np.append(start, 0.0), []
    for k in range(samples):
        found.append(state[0])
        for way, command in ((early, force[k]), (rest, force[k + 1])):
            state[4] = command
            state = way @ state
    return np.array(found)


def test_what_a_free_device_leaks_is_a_free_motion():
    """From any state, under forces before the record that nobody knows, and a constant one."""
    rng = np.random.default_rng(1)
    force, samples = rng.standard_normal(4002), 4000
    start = rng.standard_normal(4) * [1e-2, 0.3, 1e-2, 0.3]
    position = positions(force + 0.4, start, samples)
    frequency_hz = np.fft.rfftfreq(samples, PERIOD_S)[1:-1]
    model = free(period_s=PERIOD_S, delay_s=DELAY_S)
    theta = np.array([VALUES[name] for name in model.names])
    spectra = (np.fft.rfft(one)[1:-1] for one in (position, force[2:]))
    moved, driven = spectra
    leaked = moved - driven * model.response(theta[None], frequency_hz)[0]
    poles = model.system(theta).poles()[0][0]
    columns = free_motions(poles, DELAY_S, PERIOD_S, frequency_hz)
    rows = columns.copy().view(float).T
    rows /= np.linalg.norm(rows, axis=0)
    best = np.linalg.lstsq(rows, leaked.view(float), rcond=1e-14)[0]
    left = leaked.view(float) - rows @ best
    assert np.linalg.norm(leaked) > 0.1 * np.linalg.norm(moved)
    assert np.linalg.norm(left) < 1e-7 * np.linalg.norm(leaked)


def test_the_common_columns_take_what_suits_them_best(state):
    """Deviations are those of least squares over all windows, whatever else is asked at once."""
    likelihood, windows = state.fit.likelihood, state.fit.windows
    theta = state.fit.theta * (1 + 1e-3 * np.random.default_rng(2).standard_normal((5, 7)))
    plain = Likelihood(state.model, replace(windows, common=None)).deviations(theta)
    sd = np.sqrt(windows.noise)[:, None]
    rows = np.moveaxis(windows.common / sd[..., None], 2, 0).copy().view(float)
    rows = rows.reshape(len(rows), -1).T
    rows = rows / np.linalg.norm(rows, axis=0)
    measured = (plain / sd).view(float).reshape(5, -1).T
    left = measured - rows @ np.linalg.lstsq(rows, measured, rcond=1e-10)[0]
    found = likelihood.normalised(theta)
    assert found.view(float).reshape(5, -1) == pytest.approx(left.T, abs=1e-6)
    assert np.array_equal(found[3:4], likelihood.normalised(theta[3:4]))
    assert np.array_equal(likelihood(theta)[3:4], likelihood(theta[3:4]))


def test_the_limit_is_known_as_well_as_it_can_be():
    """Within 1.25 times the bound, and 2 % of sampling; with windows by themselves it is not."""
    case = make(STEPS)
    recording, truth = replace(case.recording, reference=None), case.bench.true_critical_stiffness()
    analysis = close_loop(recording, hidden=False).analysis
    limit = 20 * np.log10(analysis.limit.samples / truth)
    least = bound_db(recording, case.bench, analysis.model)
    assert abs(np.mean(limit)) < 3 * np.std(limit)
    assert 0.8 < np.std(limit) / least < 1.27
    assert analysis.fit.residual.shape == analysis.fit.frequency_hz.shape
    assert analysis.etfe.leaks_free_motion
    by_windows = critical_stiffness(draws_around(fitted(recording).fit, 1)).samples
    assert np.std(20 * np.log10(by_windows)) > 3 * least


def test_noise_alone_is_seldom_taken_for_other_leakage(state):
    """One in a thousand: of 2000 more than eight would be so once in 4,000."""
    spectra, rng = state.etfe.spectra, np.random.default_rng(5)
    shape = (2000, len(spectra.frequency_hz))
    columns = spectra.free_motions.copy().view(float).T
    span = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)[0]
    alarms = 0
    for _ in range(shape[0]):
        noise = rng.standard_normal(2 * shape[1])
        left = (noise - span @ (span.T @ noise)).view(complex)
        measured = left + spectra.force * state.fit.response(spectra.frequency_hz)
        etfe = replace(state.etfe, spectra=replace(spectra, position=measured))
        alarms += leaks_more(state.fit, etfe)
    assert alarms <= 8


@pytest.mark.parametrize("turns", [1.4, 20.5])
def test_what_else_moves_it_is_seen(state, turns):
    """A base that sways by a few counts is no free motion, and then windows are by themselves."""
    case = make(STEPS)
    assert state is not None
    phase = 2 * np.pi * turns * np.linspace(0, 1, case.recording.samples)
    sway = 5 * case.bench.encoder_resolution * np.sin(phase)
    swaying = replace(case.recording, position=case.recording.position + sway)
    assert by_free_motion(fitted(swaying)) is None


def test_of_a_held_device_nothing_is_asked(state):
    held = replace(state.model, structure=structure_named("grasped"))
    assert by_free_motion(replace(state, fit=replace(state.fit, model=held))) is None
