"""One mass that a white force disturbs: its innovations, and what is fitted to them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.follower import Follower, spring_and_damper
from bayeshaptic.inference.time_domain.innovations.filter import Disturbance, innovations
from bayeshaptic.inference.time_domain.mass_in_loop import MassInLoop
from bayeshaptic.inference.time_domain.uneven import WAVES, Way
from bayeshaptic.inference.time_domain.white_force import in_white_force, told_apart
from bayeshaptic.recordings import join_recordings, recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Floats

PERIOD_S = 1e-3
TRUTH = np.array([1.5, 9.0, 0.0, 0.3, 1.4e-3])  # mass, damping, friction, constant force, delay
FORCE_SD, COUNT = 0.05, 2e-6


def commanded(
    seconds: float,
    seed: int,
    force_sd: float = FORCE_SD,
    count: float = COUNT,
    along: float = 0.0,
    friction: float = 0.0,
    smooth: int = 60,
) -> Recording:
    """A mass under steps of a PD controller, ten exact steps a sample; a force `along` the way.

    Steps are `smooth` samples long.  The white force is held from sample to sample, the others from
    step to step.
    """
    rng = np.random.default_rng(seed)
    mass, damping, _, offset, delay_s = TRUTH
    samples, fine = round(seconds / PERIOD_S), 10
    step_s, late = PERIOD_S / fine, round(delay_s / PERIOD_S * fine)
    pushes = force_sd * rng.standard_normal(samples)
    wanted = np.repeat(rng.uniform(-0.03, 0.03, samples // 250 + 1), 250)[:samples]
    window = np.hanning(smooth)
    wanted = np.convolve(wanted, window / np.sum(window), "same")
    kept = np.exp(-damping / mass * step_s)
    x = v = last = 0.0
    force, position = np.zeros(samples), np.zeros(samples)
    for k in range(samples):
        position[k] = seen = np.round(x / count) * count
        force[k] = 900.0 * (wanted[k] - seen) - 45.0 * (seen - last) / PERIOD_S
        last = seen
        for part in range(fine):
            came = (k * fine + part - late) // fine
            pull = (force[came] if came >= 0 else 0.0) + pushes[k] - offset
            pull += along * np.sin(200.0 * x)
            # Friction brings it to rest, and no further.
            stops = pull + mass * v / step_s
            pull -= np.sign(stops) * min(abs(stops), friction)
            ends = pull / damping
            x += ends * step_s + (v - ends) * (1 - kept) * mass / damping
            v = ends + (v - ends) * kept
    return recording_from_arrays(force, position, PERIOD_S)


def led(recording: Recording, follower: Follower) -> MassInLoop:
    loop = MassInLoop.of(recording, 10.0, Way.of(recording.position))
    return replace(loop, follower=follower)


def filtered(
    loop: MassInLoop, error: Floats, disturbed: Disturbance, values: Floats = TRUTH
) -> Floats:
    """Innovations of errors with `values`, by the filter beside the truth."""
    assert loop.follower is not None
    velocity = np.gradient(loop.position - error, PERIOD_S)
    made = innovations(TRUTH, loop.follower, velocity, loop.pieces, disturbed, PERIOD_S)
    return np.asarray(made(error, values))


@pytest.mark.parametrize("factors", [(1, 1, 1), (1.03, 1, 1), (1, 1.3, 1), (1, 1, 1.4)])
def test_a_follower_is_taken_off(factors: tuple[float, float, float]) -> None:
    """With other values, too: slopes are those of a motion that only the command moves."""
    recording = commanded(1.0, seed=1)
    disturbed = Disturbance(FORCE_SD, COUNT / np.sqrt(12))
    mass, damping, delay = factors
    values = np.append(TRUTH * [mass, damping, 1, 1, delay], [0.0, 0.0])
    none = np.zeros(2 * WAVES)
    found = []
    for follower in (Follower(np.zeros(1), np.ones(1)), spring_and_damper(1.5, 8.0, PERIOD_S)):
        loop = led(recording, follower)
        found.append(filtered(loop, loop.error(values, none), disturbed, values))
    # What the command was before the recording is another thing to each for as long as the delay.
    apart = np.abs(found[0] - found[1])[10:]
    assert apart.max() < 1e-6


def test_innovations_of_the_truth_are_white() -> None:
    recording = commanded(6.0, seed=2)
    loop = led(recording, spring_and_damper(1.5, 8.0, PERIOD_S))
    error = loop.error(np.append(TRUTH, [0.0, 0.0]), np.zeros(2 * WAVES))
    new = filtered(loop, error, Disturbance(FORCE_SD, COUNT / np.sqrt(12)))[10:]
    count, lags = len(new), 20
    assert np.mean(new**2) == pytest.approx(1.0, abs=4 * np.sqrt(2 / count))
    own = [(new[k:] @ new[:-k] / (new @ new)) ** 2 for k in range(1, lags + 1)]
    assert count * np.sum(own) < chi2.isf(1e-4, lags)
    # Before the filter they are not.
    raw = error[10:] - error[10:].mean()
    assert (raw[1:] @ raw[:-1]) / (raw @ raw) > 0.9


def test_the_filter_is_that_of_plain_algebra() -> None:
    recording = commanded(0.3, seed=3, friction=0.5)
    loop = led(recording, Follower(np.zeros(1), np.ones(1)))
    values = np.append(TRUTH, [0.0, 0.0])
    values[2] = 0.5
    error = loop.error(values, np.zeros(2 * WAVES))
    velocity = np.gradient(loop.position - error, PERIOD_S)
    sizes = Disturbance(FORCE_SD, COUNT / np.sqrt(12))
    assert loop.follower is not None
    made = innovations(values, loop.follower, velocity, loop.pieces, sizes, PERIOD_S)
    from scipy.special import erf

    kept = np.exp(-TRUTH[1] / TRUTH[0] * PERIOD_S)
    far = (1 - kept) * TRUTH[0] / TRUTH[1]
    motion = np.array([[1.0, far], [0.0, kept]])
    push = np.array([(PERIOD_S - far) / TRUTH[1], (1 - kept) / TRUTH[1]])
    spread, state = np.zeros((2, 2)), np.zeros(2)
    plain, since = np.zeros(len(error)), 0
    still = [velocity[max(k - 4, 0) : k + 5] == 0.0 for k in range(len(error))]
    rests = [bool(np.any(np.convolve(one, np.ones(5), "valid") == 5)) for one in still]
    assert 0 < np.mean(rests) < 0.5
    for k in range(len(error)):
        total = spread[0, 0] + sizes.position_sd**2
        if rests[k] or (k and rests[k - 1]):  # the filter begins anew where the mass does
            let_go = 5 * push[1] * 0.5  # samples of friction's force
            spread, state = np.diag([sizes.position_sd**2, let_go**2]), np.array([error[k], 0])
            since = 3
            total = np.inf
        plain[k] = (error[k] - state[0]) / np.sqrt(total)
        gain = spread[:, 0] / total
        state = motion @ (state + gain * (error[k] - state[0]))
        spread = spread - np.outer(gain, spread[0])
        with np.errstate(divide="ignore", invalid="ignore"):
            sure = velocity[k] / np.sqrt(max(spread[1, 1], 0.0))
        sign = 0.0 if np.isnan(sure) else erf(sure / np.sqrt(2))
        pushed = sizes.force_sd**2 + (1 - sign**2) * 0.5**2
        spread = motion @ spread @ motion.T + pushed * np.outer(push, push)
        if since < 3:
            spread[1, 1] += (100 * sizes.position_sd / PERIOD_S) ** 2
        since += 1
    assert np.allclose(made(error, values), plain, rtol=1e-6, atol=1e-6)


@pytest.fixture(scope="module")
def fits() -> list[tuple[MotionFit, MotionFit]]:
    """Of recordings under a white force: with equal weights, and to innovations."""
    made = [commanded(4.0, seed) for seed in range(10, 18)]
    found = [fit_motion(one) for one in made]
    return [(one, in_white_force(one, rec)) for one, rec in zip(found, made, strict=True)]


def test_a_white_force_is_known(fits: list[tuple[MotionFit, MotionFit]]) -> None:
    white = [found.disturbed for _, found in fits if found.disturbed is not None]
    assert len(white) >= len(fits) - 2  # tests that chance fails once in 500 times, and Hausman's
    # Over these eight recordings the force's size has a standard deviation of 7 %, and the counts'
    # one of 1 %.
    for one in white:
        assert one.force_sd == pytest.approx(FORCE_SD, rel=4 * 0.07)
        assert one.position_sd == pytest.approx(COUNT / np.sqrt(12), rel=4 * 0.01)


def test_intervals_hold_and_are_narrower(fits: list[tuple[MotionFit, MotionFit]]) -> None:
    white = [(plain, found) for plain, found in fits if found.disturbed is not None]
    far = np.array([(found.values - TRUTH) / found.sd for _, found in white])
    known = [0, 1, 3, 4]  # friction there is none: at its bound
    # Student's t of eight degrees of freedom has a variance of 8 / 6.
    assert np.sum(far[:, known] ** 2) < 8 / 6 * chi2.isf(1e-4, len(white) * len(known))


def test_where_only_counts_disturb_it_says_much_more() -> None:
    recording = commanded(4.0, seed=30, force_sd=0.0)
    plain = fit_motion(recording)
    found = in_white_force(plain, recording)
    known = [0, 1, 3, 4]
    assert np.all(found.sd[known] < 0.3 * plain.sd[known])
    far = (found.values - TRUTH)[known] / found.sd[known]
    assert np.sum(far**2) < 8 / 6 * chi2.isf(1e-4, len(known))


def test_a_force_along_the_way_is_not_white() -> None:
    recording = commanded(4.0, seed=20, along=0.3)
    found = fit_motion(recording)
    assert in_white_force(found, recording) is found


def test_a_mass_that_rests_is_fitted_to_its_moves() -> None:
    recording = commanded(3.0, seed=21, friction=4.0)
    plain = fit_motion(recording)
    found = in_white_force(plain, recording)
    assert found.disturbed is not None
    resting = np.mean(np.diff(found.simulated) == 0.0)
    assert resting > 0.25
    truth = TRUTH.copy()
    truth[2] = 4.0
    assert found.sd[0] < plain.sd[0]
    far = (found.values - truth) / found.sd
    assert np.sum(far**2) < 8 / 6 * chi2.isf(1e-4, len(far))


def test_what_a_controller_makes_of_counts_leaves_the_delay_right() -> None:
    """It moves the mass by less than a count, mostly; pieces are fitted to innovations."""
    far = []
    for seed in (22, 24, 26):
        pieces = [commanded(3.0, seed + 100 * piece, count=1e-5) for piece in range(2)]
        recording = join_recordings(pieces)
        found = in_white_force(fit_motion(recording), recording)
        assert found.disturbed is not None
        far.append((found.values - TRUTH) / found.sd)
    known = [0, 1, 3, 4]  # friction there is none: at its bound
    assert np.sum(np.array(far)[:, known] ** 2) < 8 / 6 * chi2.isf(1e-4, len(far) * len(known))


def test_columns_that_are_nearly_one_tell_no_values_apart() -> None:
    rng = np.random.default_rng(7)
    columns = rng.standard_normal((1000, 5))
    assert told_apart(columns)
    for share, apart in ((0.2, True), (0.05, False)):  # 26 and 400 times the variance
        alike = columns.copy()
        alike[:, 4] = alike[:, 0] + share * columns[:, 4]
        assert told_apart(alike) is apart
