"""What the least width of a held device's limit is computed from."""

from dataclasses import replace

import numpy as np
from scipy.linalg import solve_toeplitz

from bayeshaptic import LogNormal
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models.build import build_model
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from bayeshaptic.rig import Bench, run_loop
from benchmarks.bounds.held import bound_db, noise_covariance
from benchmarks.through_reference import make

SAMPLES = 1500
SHORT = 44  # a held PHANToM that follows noise for 3.8 s


def test_what_a_hand_adds_has_that_covariance():
    """Of the right covariance N numbers leave N, as a chi-square; of a tenth more, not."""
    usual = Bench.from_device("phantom", True, "grasped")
    bench = replace(usual, encoder_resolution=0.0, sensor_noise_rms=usual.encoder_resolution)
    covariance = noise_covariance(bench, SAMPLES)
    found = []
    for seed in range(8):
        made = run_loop(bench, lambda k, position: 0.0, 2 * SAMPLES * bench.period_s, seed)
        settled = made.position[-SAMPLES:]  # it began at rest
        found.append(settled @ solve_toeplitz(covariance, settled))
    sd = np.sqrt(2 / (len(found) * SAMPLES))
    assert abs(np.mean(found) / SAMPLES - 1) < 4 * sd
    assert abs(np.mean(found) / SAMPLES / 1.1 - 1) > 4 * sd


def test_the_bound_falls_with_the_noise_that_is_white():
    """Half the counts, half the width, where the hand keeps still."""
    case = make(SHORT)
    recording = replace(case.recording.part(0, 800), reference=None)
    still = replace(case.bench, wander_rms=0.0, tremor_rms=0.0)
    finer = replace(still, encoder_resolution=still.encoder_resolution / 2)
    model = build_model("grasped", period_s=recording.period_s)
    fitted = least_squares(model, estimate_by_direct_method(recording)).model
    known = [name for name in fitted.names if case.bench.values.get(name, 1.0) > 0]
    bare = fitted.with_prior(dict.fromkeys(known, LogNormal(1.0, 50.0)))
    coarse, fine = (bound_db(recording, bench, bare) for bench in (still, finer))
    assert abs(coarse / fine - 2) < 0.02
    assert bound_db(recording, case.bench, fitted) > bound_db(recording, still, fitted)


def test_rounding_counts_with_its_own_spectrum():
    """White rounding is what the bound takes it for without; what changes slowly hides more."""
    case = make(SHORT)
    recording = replace(case.recording.part(0, 800), reference=None)
    model = build_model("grasped", period_s=recording.period_s)
    fitted = least_squares(model, estimate_by_direct_method(recording)).model
    count, found = case.bench.encoder_resolution, []
    for rng in map(np.random.default_rng, range(16)):
        white = count * rng.uniform(-0.5, 0.5, recording.samples)
        slow = 2 * np.convolve(white, np.ones(4) / 4, "same")  # of the same variance
        found.append(
            [bound_db(recording, case.bench, fitted, one) for one in (white, slow)],
        )
    # A spectrum that is smooth over 30 lines is known to 13 %, a width to half of that.
    as_white, as_slow = np.mean(found, axis=0) / bound_db(recording, case.bench, fitted)
    assert abs(as_white - 1) < 3 * 0.067 / np.sqrt(len(found))
    assert as_slow > 1.1


def test_what_noise_makes_of_the_command_tells_only_who_knows_the_noise():
    """Without it the bound is wider, and hardly where the command is a strong reference's."""
    case = make(SHORT)
    quiet = case.without_noise()
    assert np.std(quiet.force - case.recording.force) < 0.2 * np.std(quiet.force)
    recording = replace(case.recording, reference=None)
    model = build_model("grasped", period_s=recording.period_s)
    fitted = least_squares(model, estimate_by_direct_method(recording)).model
    known, of_any_noise = (
        bound_db(one, case.bench, fitted, case.rounding) for one in (recording, quiet)
    )
    assert 1.0 <= of_any_noise / known < 1.1
