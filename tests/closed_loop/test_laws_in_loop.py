"""What the motion of one mass in its loop lacks: laws that join it, and what speaks against it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.signal import butter, sosfilt
from test_time_domain import GAINS, TRUTH, declared, in_loop, stepped

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.feedback.in_loop import follow_in_loop
from bayeshaptic.diagnosis.feedback.lacking import with_laws
from bayeshaptic.diagnosis.feedback.tones_in_motion import tones_of
from bayeshaptic.diagnosis.feedback.unlike_one_mass import unlike_one_mass
from bayeshaptic.errors import InputError
from bayeshaptic.inference.time_domain.fit import MotionFit, fit_motion
from bayeshaptic.inference.time_domain.follower import Follower
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES, Hum
from bayeshaptic.inference.time_domain.scores import scores
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.feedback import Feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline
from bayeshaptic.report.loop import force_words
from bayeshaptic.rig import Bench, run_loop

_REACH = 4.5  # standard deviations: 1 in 500 with eight degrees of freedom
BARE = {"m": TRUTH["m"], "b": TRUTH["b"]}
FOLLOWER = Follower(*Feedback(*GAINS).law(1e-3))
STRIBECK = {"force": 1.5, "static": 2.4, "velocity": 0.02}


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench(
        "rigid",
        {"m": TRUTH["m"], "b": TRUTH["b"]},
        delay_s=TRUTH["delay_s"],
        encoder_resolution=2e-6,
    )


@pytest.mark.parametrize(
    ("effect", "numbers", "estimate", "truth"),
    [
        ("drag", {"coefficient": 150.0}, "drag_coefficient", 150.0),
        ("stribeck_friction", STRIBECK, "static_excess", 0.6),
        ("stribeck_friction", STRIBECK, "stribeck_velocity", 0.02),
    ],
)
def test_a_law_of_the_table_joins_the_mass(
    bench: Bench, effect: str, numbers: dict[str, float], estimate: str, truth: float
) -> None:
    recording = stepped(bench.with_effect(effect, **numbers), 4.0)
    motion, laws, doubts = with_laws(recording, FOLLOWER)
    assert [law.effect.name for law in laws] == [effect]
    assert doubts == ()
    value, sd = laws[0].estimates[estimate]
    assert abs(value - truth) < _REACH * sd
    assert sd < 0.05 * truth
    wanted = np.array([TRUTH["m"], TRUTH["b"], numbers.get("force", 0.0), 0.0, TRUTH["delay_s"]])
    assert np.all(np.abs(motion.values - wanted) < _REACH * motion.sd)
    # Without it the damping takes its part.
    alone = fit_motion(recording, FOLLOWER)
    assert motion.error_rms < 0.5 * alone.error_rms


def test_nothing_joins_a_mass_with_dry_friction() -> None:
    motion, laws, doubts = with_laws(in_loop(4.0, TRUTH["coulomb"], 2e-6), FOLLOWER)
    assert laws == ()
    assert doubts == ()
    assert motion.error_rms < 2e-6


def test_a_base_that_gives_and_damping_that_changes_are_seen(bench: Bench) -> None:
    gives = bench.with_effect("base_compliance", frequency_hz=25.0, mass_ratio=3.0)
    _, _, doubts = with_laws(stepped(gives, 4.0), FOLLOWER)
    assert len(doubts) == 1
    assert "the damping is another at other frequencies" in doubts[0]
    recording = in_loop(4.0, 0.0, 2e-6)
    motion = fit_motion(recording, FOLLOWER)
    velocity = np.gradient(recording.position, 1e-3)
    pulled = 2.0 * np.linspace(-1, 1, recording.samples) * velocity
    # As if the mass had been held back less at first: in the command that is a force of its own.
    changed = replace(recording, force=recording.force + pulled, feedback=None)
    _, _, doubts = with_laws(changed, None)
    assert any("the damping changes" in doubt for doubt in doubts)
    assert motion.converged


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (lambda u, most: most * np.arctanh(u / most), "another share of large commands"),
        (lambda u, _: u / np.where(u > 0, 1.1, 0.9), "one way than the other"),
    ],
)
def test_a_motor_that_does_not_give_what_is_commanded_is_seen(given: Any, why: str) -> None:
    """As if less or more had been given: in the record that is another command."""
    recording = replace(in_loop(4.0, 0.0, 2e-6), feedback=None)
    assert with_laws(recording, None)[2] == ()
    most = 2 * float(np.abs(recording.force).max())
    commanded = replace(recording, force=given(recording.force, most))
    motion, _, doubts = with_laws(commanded, None)
    assert len(doubts) == 1 and why in doubts[0]
    mass = NAMES.index("m")
    assert motion.values[mass] > 1.01 * TRUTH["m"]  # and with it a limit that is too high


def test_a_score_is_the_strength_that_a_fit_finds(bench: Bench) -> None:
    faint = stepped(bench.with_effect("drag", coefficient=5.0), 4.0)
    motion = fit_motion(faint, FOLLOWER)
    velocity = np.gradient(faint.position, 1e-3)
    (found,) = scores(motion, faint, [-velocity * np.abs(velocity)])
    assert found is not None
    assert abs(found.strength - 5.0) < _REACH * found.sd
    # A column that is there already says nothing, as the size of a command of two levels.
    two_levels = 0.7 * np.where(np.arange(faint.samples) % 7 < 3, 1.0, -1.0)
    assert scores(motion, faint, [np.zeros(faint.samples), np.abs(two_levels)]) == [None, None]
    # The constant force beside another changes nothing.
    (pushed,) = scores(motion, faint, [40.0 - velocity * np.abs(velocity)])
    assert pushed is not None
    assert pushed.strength == pytest.approx(found.strength, abs=0.1 * found.sd)


def test_half_a_recording_predicts_the_other_from_wherever_it_begins() -> None:
    found = follow_in_loop(in_loop(4.0, 0.0, 2e-6))
    assert found is not None
    assert found.held_out == pytest.approx(1.0, abs=0.05)
    assert found.doubts == ()


def test_what_is_not_one_mass_gets_no_stiffness(bench: Bench) -> None:
    gives = bench.with_effect("base_compliance", frequency_hz=25.0, mass_ratio=3.0)
    closed = close_loop(stepped(gives, 4.0), "rigid", ess=600)
    assert closed.verdict == "unexplained"
    assert headline(closed).status == "untrusted"


def test_laws_are_named_with_their_numbers(bench: Bench) -> None:
    closed = close_loop(
        declared(stepped(bench.with_effect("stribeck_friction", **STRIBECK), 4.0)), "rigid", ess=600
    )
    assert closed.verdict == "explained"
    assert closed.effect_names == ("stribeck_friction",)
    named = closed.effects[0]
    assert set(named.estimates) == {"static_excess", "stribeck_velocity"}
    assert named.parameters == ("coulomb",)
    assert headline(closed).status == "caution"
    assert NAMES[2] in closed.analysis.posterior.model.names


def test_friction_that_the_motion_does_not_have_is_not_named(bench: Bench) -> None:
    # The force along the motion alone takes what a constant does in part for dry friction.
    recording = stepped(bench.with_effect("constant_force"), 10.0)
    closed = close_loop(recording, "rigid", ess=300)
    assert closed.verdict == "consistent"
    assert closed.effect_names == ()


def test_a_response_that_says_nothing_of_the_delay_is_refused(bench: Bench) -> None:
    """Draws around such a fit had delays of thousands of samples, each a pole to look for."""
    recording = declared(stepped(bench.with_effect("centring_stiffness"), 10.0))
    closed = close_loop(recording, "rigid", ess=300)
    assert headline(closed).status == "untrusted"
    drawn = closed.analysis.posterior.chains
    assert np.all(np.isfinite(drawn))
    if "delay_s" in closed.analysis.model.names:
        assert drawn[..., closed.analysis.model.names.index("delay_s")].max() < 0.1


def test_a_law_with_which_no_motion_stays_near_leaves_the_mass_as_it_was(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def runs_away(*arguments: Any) -> MotionFit:
        raise InputError("no motion of one mass stays near the measured one")

    monkeypatch.setattr("bayeshaptic.diagnosis.feedback.refit.fit_motion", runs_away)
    recording = stepped(bench.with_effect("stribeck_friction", **STRIBECK), 4.0)
    motion, laws, _ = with_laws(recording, FOLLOWER)
    assert laws == ()
    assert np.array_equal(motion.values, fit_motion(recording, FOLLOWER).values)


def test_what_speaks_against_a_limit_stands_where_half_is_not_enough(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def too_short(*arguments: Any) -> MotionFit:
        raise InputError("no motion of one mass stays near the measured one")

    monkeypatch.setattr("bayeshaptic.diagnosis.feedback.in_loop.fit_motion", too_short)
    gives = bench.with_effect("base_compliance", frequency_hz=25.0, mass_ratio=3.0)
    found = follow_in_loop(declared(stepped(gives, 4.0)))
    assert found is not None
    against, short = found.doubts
    assert "the damping is another at other frequencies" in against
    assert short == "half of the recording is not enough"


def slow() -> tuple[Recording, Follower]:
    """Ten seconds of one mass that follows noise up to 1.5 Hz, read in counts of 20 um."""
    spring, damper = 100.0, 15.0
    low = butter(2, 1.5, fs=1e3, output="sos")
    wanted = sosfilt(low, np.random.default_rng(1).normal(size=10_000))
    wanted *= 0.02 / wanted.std()
    last = [0.0]

    def controller(k: int, position: float) -> float:
        rate, last[0] = (position - last[0]) / 1e-3, position
        return float(spring * (wanted[k] - position) - damper * rate)

    bench = Bench("rigid", BARE, delay_s=TRUTH["delay_s"], encoder_resolution=2e-5)
    done = run_loop(bench, controller, 10.0)
    recording = recording_from_arrays(done.force, done.position, period_s=1e-3)
    return recording, Follower(*Feedback(spring, damper).law(1e-3))


def test_counts_are_not_taken_for_damping_that_fades() -> None:
    """Along the measured motion, smoothed, the fastest had t = 14: the part of it that is no mass
    and no damping was what counts add, which is what a fit leaves."""
    recording, follower = slow()
    motion = fit_motion(recording, follower)
    forces = [force for _, force in unlike_one_mass(recording, motion.velocity(recording))]
    seen = [score for score in scores(motion, recording, forces) if score is not None]
    assert len(seen) > 4
    assert all(abs(score.t) < _REACH for score in seen)


@pytest.mark.parametrize("levels", [(1.0, -1.0), (1.3, -0.8), (1.0, -1.0, 0.0)])
def test_a_power_of_a_command_of_two_levels_is_no_force_of_its_own(levels: Any) -> None:
    """It had t = 6 to 17 in clean recordings: the command itself, which no fit has as a column."""
    rng = np.random.default_rng(3)
    command = 3.0 * np.repeat(rng.choice(levels, 500), rng.integers(1, 30, 500))[:4000]
    bench = Bench("rigid", BARE, delay_s=TRUTH["delay_s"], encoder_resolution=2e-6)
    done = run_loop(bench, lambda k, _: float(command[k]), 4.0)
    recording = recording_from_arrays(done.force, done.position, period_s=1e-3)
    motion = fit_motion(recording, None)
    asked = unlike_one_mass(recording, motion.velocity(recording))
    (cubed,) = (force for why, force in asked if "large commands" in why)
    assert not cubed.any() and scores(motion, recording, [cubed]) == [None]


def test_what_is_unlike_one_mass_is_so_in_any_unit_of_time() -> None:
    """A device that is as quick as its clock: the same samples, of another period."""
    recording = in_loop(2.0, 0.0, 2e-6)
    quick = replace(recording, period_s=1e-4)
    velocity = np.gradient(recording.position, 1e-3)
    usual, quicker = (
        unlike_one_mass(one, times * velocity) for one, times in ((recording, 1), (quick, 10))
    )
    for (_, one), (_, other) in zip(usual, quicker, strict=True):
        assert other / other.std() == pytest.approx(one / one.std(), abs=1e-9)


def humming(bench: Bench, **tone: Any) -> Recording:
    rubs = bench.with_effect("coulomb_friction", force=TRUTH["coulomb"])
    return stepped(rubs.with_effect("mains_tone", **tone), 4.0)


@pytest.mark.parametrize(
    "tone",
    [
        {"on": "force", "amplitude": 0.5, "frequency_hz": 50.03},
        {"on": "force", "amplitude": 2.0, "frequency_hz": 33.0},
        {"on": "position", "amplitude": 3e-6, "frequency_hz": 60.0},
    ],
    ids=["mains", "something that turns", "hum of the sensor"],
)
def test_a_tone_is_fitted_with_the_motion(bench: Bench, tone: dict[str, Any]) -> None:
    found = follow_in_loop(humming(bench, **tone))
    assert found is not None
    assert (found.doubts, found.laws) == ((), ())  # such as damping that fades with the frequency
    (hum,) = found.motion.hums
    assert abs(hum.frequency_hz - tone["frequency_hz"]) < 0.01
    truth = np.array([TRUTH["m"], TRUTH["b"], TRUTH["coulomb"], 0.0, TRUTH["delay_s"]])
    assert np.all(np.abs(found.motion.values - truth) < _REACH * found.motion.sd)
    (told,) = tones_of(found.motion)
    assert told.of_the_mains == (tone["frequency_hz"] != 33.0)
    if tone["on"] == "force":
        assert abs(abs(told.amplitude) - tone["amplitude"]) < 0.02 * tone["amplitude"]


def test_the_limit_stands_with_a_mains_tone(bench: Bench) -> None:
    closed = close_loop(declared(humming(bench, on="force", amplitude=0.5)), "rigid", ess=600)
    assert closed.verdict == "explained"
    assert closed.effect_names == ("coulomb_friction", "mains_tone")
    assert "50.00 Hz (0.5 N, mains)" in force_words.motion(closed.analysis)
    assert headline(closed).stiffness is not None
    quiet = bench.with_effect("coulomb_friction", force=TRUTH["coulomb"])
    alone = close_loop(declared(stepped(quiet, 4.0)), "rigid", ess=600)
    there, here = (one.analysis.limit.quantile(0.5) for one in (alone, closed))
    assert here == pytest.approx(there, rel=0.01)


def test_a_clean_loop_does_not_hum(bench: Bench) -> None:
    for recording in (in_loop(4.0, TRUTH["coulomb"], 2e-6), in_loop(4.0, 0.0, 2e-5)):
        found = follow_in_loop(recording)
        assert found is not None
        assert found.motion.hums == ()


def test_a_hum_goes_on() -> None:
    hum = Hum(50.0, 1.0 - 2.0j)
    time_s = np.array([0.0, 1.3e-3])
    later = hum.later(0.0123)
    wave = [
        np.real(h.amplitude * np.exp(2j * np.pi * 50.0 * t))
        for h, t in ((hum, time_s + 0.0123), (later, time_s))
    ]
    assert wave[0] == pytest.approx(wave[1])
