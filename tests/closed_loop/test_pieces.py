"""Several recordings of one device as one: pieces in open loop and under a controller."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from on_the_bench import usual_noise

import bayeshaptic as bh
from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.base.opened import opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.pieces import force_in_pieces
from bayeshaptic.diagnosis.residuals.residual import Test as ResidualTest
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.inference.time_domain.fit import fit_motion
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.inference.time_domain.uneven import Ridge
from bayeshaptic.inference.time_domain.widths.between_pieces import between_pieces
from bayeshaptic.models import build_model
from bayeshaptic.recordings import Recording, recording_from_arrays
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import compress
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, run_loop, simulate
from bayeshaptic.study.analysed import names_of

PERIOD_S = 1e-3
TRUTH = {"m": 2.0, "b": 20.0, "coulomb": 1.2, "offset": 0.5, "delay_s": 0.8e-3}


def steps(seconds: float, seed: int) -> Recording:
    """Position steps of a rigid device with dry friction under a PD controller."""
    bench = Bench("rigid", {"m": TRUTH["m"], "b": TRUTH["b"]}, delay_s=TRUTH["delay_s"])
    bench = bench.with_effect("coulomb_friction", force=TRUTH["coulomb"])
    goals = np.random.default_rng(seed).uniform(-0.04, 0.04, 10)
    last = [0.0]

    def controller(k: int, position: float) -> float:
        rate, last[0] = (position - last[0]) / PERIOD_S if k else 0.0, position
        return float(1500.0 * (goals[k // 450] - position) - 60.0 * rate)

    done = run_loop(bench, controller, seconds, seed=seed)
    position = np.round(done.position / 2e-6) * 2e-6
    return recording_from_arrays(
        done.force + TRUTH["offset"], position, PERIOD_S, force_unit="N", name=f"step {seed}"
    )


def noise(seconds: float, seed: int) -> Recording:
    """White noise on a free Phantom."""
    bench = Bench.from_device("phantom", False, "free")
    done = simulate(bench, WhiteNoise(bench.force_rms, 400, 0.5, seconds), seed=seed)
    return recording_from_arrays(**done.signals)


@pytest.fixture(scope="module")
def series() -> list[Recording]:
    return [steps(seconds, seed) for seed, seconds in enumerate((0.7, 1.3, 2.4, 1.0))]


def test_a_joined_recording_falls_into_its_pieces(series: list[Recording]) -> None:
    joined = bh.join_recordings(series)
    assert joined.name == "step 0 and 3 others" and joined.samples == sum(r.samples for r in series)
    for piece, one in zip(joined.pieces, series, strict=True):
        assert np.array_equal(piece.position, one.position) and not piece.joints
    assert joined.part(600, 2100).joints == (100, 1400)
    assert np.abs(np.diff(unbroken(joined).position)).max() < 1e-3
    assert bh.join_recordings(series[:1]) is series[0]


def test_what_differs_in_period_or_unit_cannot_be_one(series: list[Recording]) -> None:
    slow = recording_from_arrays(series[0].force, series[0].position, 2e-3, force_unit="N")
    with pytest.raises(bh.InputError, match="sampled every 0.002 s"):
        bh.join_recordings([series[0], slow])
    with pytest.raises(bh.InputError, match="same units"):
        bh.join_recordings([series[0], noise(1.0, 0)])
    with pytest.raises(bh.InputError, match="step 1 has the same samples as step 1, and would"):
        bh.join_recordings([series[0], series[1], series[1]])
    with pytest.raises(bh.InputError, match="too few even for a piece"):
        bh.join_recordings([series[0], series[1].part(0, 100)])


def test_short_steps_under_a_controller_count_together(series: list[Recording]) -> None:
    found = fit_motion(bh.join_recordings(series))
    apart = np.abs(found.values - np.array([TRUTH[name] for name in NAMES])) / found.sd
    assert apart.max() < 3.4  # 99 % of a Student t with eight degrees of freedom
    alone = fit_motion(series[2])
    assert np.all(found.sd[:2] < alone.sd[:2])


# What is fitted besides may take up much of what is apart, as a force along the way does.
@pytest.mark.parametrize(("spread", "besides"), [(0.0, 0), (0.5, 0), (0.5, 7)])
def test_friction_that_differs_between_pieces_is_in_the_widths(spread: float, besides: int) -> None:
    rng = np.random.default_rng(3)
    pieces = [slice(start, start + 50) for start in range(0, 600, 50)]
    estimates, told = [], []
    for _ in range(300):
        columns = np.zeros((600, 1 + len(pieces) + besides))
        columns[:, 0] = rng.standard_normal(600)
        for number, piece in enumerate(pieces):
            columns[piece, 1 + number] = 1.0
            turns = np.pi * (number + 0.5) / len(pieces) * np.arange(1, 1 + besides)
            columns[piece, 1 + len(pieces) :] = columns[piece, :1] * np.cos(turns)
        friction = 2.0 + spread * np.repeat(rng.standard_normal(len(pieces)), 50)
        target = friction * columns[:, 0] + rng.standard_normal(600)
        inverse = np.linalg.inv(columns.T @ columns)
        solution = inverse @ columns.T @ target
        none = np.zeros(columns.shape[1])
        found = Ridge(solution, inverse, none, none, 13.0 + besides)
        own = [np.array([1 + number]) for number in range(len(pieces))]
        left = target - columns @ solution
        added = between_pieces(columns, left, found, pieces, np.array([0]), own, 600.0)
        told.append(inverse[0, 0] + added[0, 0])
        estimates.append(solution[0])
    # 300 estimates know their variance to 8 %; that of the spread is meant to be a little large.
    assert 0.75 < np.mean(told) / np.var(estimates) < 1.6


def test_short_steps_become_a_limit(series: list[Recording]) -> None:
    closed = bh.close_loop(bh.join_recordings(series), "rigid", ess=300)
    assert closed.analysis.in_loop is not None and headline(closed).stiffness is not None
    found = closed.analysis.posterior.summary()
    for name in ("m", "b", "coulomb"):
        assert abs(found[name]["mean"] - TRUTH[name]) < 4 * found[name]["sd"]


def test_pieces_in_open_loop_are_a_sum_of_likelihoods() -> None:
    pieces = [noise(seconds, seed) for seed, seconds in enumerate((1.2, 2.3, 4.1, 3.0))]
    etfe = estimate_etfe(bh.join_recordings(pieces))
    assert etfe.unbroken is None and etfe.recording is not None
    fit = least_squares(build_model("free", period_s=PERIOD_S), etfe)
    assert fit.reduced_chi_square < 1.3
    theta = fit.theta * np.array([[1.0], [1.01]])
    parts = sum(
        Likelihood(fit.model, compress(estimate_etfe(piece), fit.response))(theta)
        for piece in pieces
    )
    whole = Likelihood(fit.model, compress(etfe, fit.response))(theta)
    assert whole[1] - whole[0] == pytest.approx(parts[1] - parts[0], rel=1e-9)
    truth = Bench.from_device("phantom", False, "free").values
    for name in ("m1", "kc", "m2"):
        index = fit.model.names.index(name)
        assert abs(fit.theta[index] - truth[name]) < 4 * fit.sd[index]


def test_a_study_joins_what_nothing_tells_apart(tmp_path: Path) -> None:
    for number, seconds in enumerate((1.2, 1.5, 1.1)):
        one = noise(seconds, number)
        rows = np.stack([np.arange(one.samples) * PERIOD_S, one.force, one.position], axis=1)
        header = "time_s,torque_nm,angle_rad"
        np.savetxt(tmp_path / f"{number}.csv", rows, delimiter=",", header=header, comments="")
    entries = "".join(f'[[recording]]\nfile = "{n}.csv"\ntrial = {n // 2}\n' for n in range(3))
    device = '[device]\nname = "phantom"\n'
    path = tmp_path / "study.toml"

    def read(top: str) -> list[int]:
        path.write_text(top + device + entries, encoding="utf-8")
        study = bh.read_study(path)
        return [len(one.pieces) for one in study.read_all() if isinstance(one, Recording)]

    assert read("") == [2, 1]  # a trial of its own tells the third apart
    assert read("pool = true\n") == [3]
    assert read("pool = false\n") == [1, 1, 1]
    with pytest.raises(bh.InputError, match="pool"):
        read('pool = "yes"\n')
    (tmp_path / "1.csv").write_text("time_s,torque_nm,angle_rad\n0,1,oops\n")
    assert read("pool = true\n") == [2]  # one that cannot be read takes none with it
    study = bh.read_study(path)
    joined = study.read_all()[0]
    assert isinstance(joined, Recording) and joined.source is None  # of no one file
    assert (joined.name, names_of(study.entries)) == ("0 and 1 other", ["0 and 2 others"])
    assert any(n.level == "warning" and "1.csv" in n.text for n in joined.notices)


def test_recordings_of_several_periods_count_together_by_period(tmp_path: Path) -> None:
    """They were joined, and then refused."""
    for number, period_s in enumerate((1e-3, 5e-4, 1.0002e-3, 5e-4)):
        rows = np.random.default_rng(number).standard_normal((1200, 3))
        rows[:, 0] = np.arange(1200) * period_s
        header = "time_s,torque_nm,angle_rad"
        np.savetxt(tmp_path / f"{number}.csv", rows, delimiter=",", header=header, comments="")
    (tmp_path / "4.csv").write_text("time_s,torque_nm,angle_rad\n0,1,oops\n")
    entries = "".join(f'[[recording]]\nfile = "{n}.csv"\n' for n in range(5))
    path = tmp_path / "study.toml"
    path.write_text('[device]\nname = "phantom"\n' + entries, encoding="utf-8")
    study = bh.read_study(path).with_periods_apart()
    names = [[one.path.stem for one in (entry, *entry.more)] for entry in study.entries]
    assert names == [["0", "2", "4"], ["1", "3"]]
    slow, fast = (one for one in study.read_all() if isinstance(one, Recording))
    assert slow.period_s == pytest.approx(1e-3) and len(slow.pieces) == 2
    assert fast.period_s == pytest.approx(5e-4) and len(fast.pieces) == 2
    assert any("4.csv" in notice.text for notice in slow.notices)


def test_pieces_in_open_loop_say_what_is_not_looked_for_in_them() -> None:
    rng = np.random.default_rng(4)
    force = rng.standard_normal((2, 4000))
    position = np.cumsum(np.cumsum(force, axis=1), axis=1) * 1e-6
    pieces = [bh.recording_from_arrays(u, x, 1e-3) for u, x in zip(force, position, strict=True)]
    (notice,) = (
        n
        for n in begin(bh.join_recordings(pieces), "rigid", Options()).notices
        if (n.level, n.topic) == ("warning", "pieces")
    )
    assert "friction" in notice.text
    alone = begin(pieces[0], "rigid", Options()).notices
    assert not any(n.topic == "pieces" for n in alone)


def lhifam(friction: float, seconds: float, seeds: range) -> list[Recording]:
    """White noise on a free LHIfAM that rubs with a share of the force's rms."""
    bench = Bench.from_device("lhifam", False, "free")
    if friction:
        bench = bench.with_effect("coulomb_friction", force=friction * bench.force_rms)
    played = usual_noise(bench, seconds)
    made = [simulate(bench, played, seed=seed) for seed in seeds]
    return [bh.recording_from_arrays(**one.signals) for one in made]


def scores(recordings: list[Recording]) -> dict[str, ResidualTest]:
    """The tests for a force of recordings taken as one."""
    etfe = estimate_etfe(bh.join_recordings(recordings))
    fit = least_squares(build_model("free", period_s=etfe.period_s), etfe)
    return {test.name: test for test in force_in_pieces(fit, etfe)}


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_friction_shows_in_pieces(friction: float) -> None:
    found = [
        name for name, test in scores(lhifam(friction, 5.0, range(1, 3))).items() if test.flagged
    ]
    assert ("sign(v)" in found) == bool(friction)


def test_pieces_show_together_what_the_longest_does_not() -> None:
    series = lhifam(0.0007, 5.0, range(6))
    whole = scores(series)["sign(v)"]
    alone = [scores([one])["sign(v)"] for one in series]
    assert whole.flagged and not any(test.flagged for test in alone)
    assert whole.force is not None and alone[0].force is not None
    assert whole.force.sd == pytest.approx(alone[0].force.sd / np.sqrt(6), rel=0.3)
    # Of nothing the scores are those of chance: the 99.9 % point of chi-square of eight.
    nothing = [scores(lhifam(0.0, 2.5, range(3 * n, 3 * n + 3)))["sign(v)"] for n in range(8)]
    assert np.sum([test.statistic**2 for test in nothing]) < 26.1


def test_the_one_piece_that_counts_is_as_if_recorded_alone() -> None:
    """Friction was looked for in the longest piece, which was not in the response at all."""
    bench = Bench.from_device("phantom", False, "free").with_effect("coulomb_friction", force=0.004)
    played = WhiteNoise(bench.force_rms, 400, 0.5, 3.0), Multisine(bench.force_rms, 1, 120, 1.0, 6)
    made = [simulate(bench, each, seed=seed) for seed, each in enumerate(played)]
    pieces = [bh.recording_from_arrays(**one.signals) for one in made]
    begun = begin(bh.join_recordings(pieces), "free", Options())
    assert begun.etfe.unbroken is not None and begun.etfe.unbroken.samples == pieces[0].samples
    (told,) = (n.text for n in begun.notices if (n.level, n.topic) == ("warning", "pieces"))
    assert "1 of 2 (number 2): they have a force that repeats" in told


@pytest.mark.parametrize("first", [200, 210])
def test_pieces_of_noise_are_no_loop(first: int) -> None:
    """They were one: what a piece begins with tells of the end of the one before."""
    bench = Bench.from_device("lhifam")
    excitation = WhiteNoise(bench.force_rms, 300.0, 0.3, 3.0)
    made = [simulate(bench, excitation, seed=seed) for seed in range(first, first + 4)]
    pieces = [recording_from_arrays(**one.signals) for one in made]
    topics = {
        notice.topic for notice in opened(bh.join_recordings(pieces), "free", Options()).notices
    }
    assert "pieces" in topics and "feedback" not in topics
