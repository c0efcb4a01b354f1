"""Terms of a force: chosen by what they predict, errors by what the choice leaves open."""

from __future__ import annotations

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.diagnosis.feedback.choose_terms import Regression, between_sets, choose_terms
from bayeshaptic.diagnosis.feedback.smooth_motion import at_rest

RNG = np.random.default_rng(7)
START = ("mass", "damping")
TRUE = {"mass": 2.0, "damping": 3.0, "coulomb": 1.5, "spring": -4.0}
COLUMNS = {
    name: RNG.standard_normal(400)
    for name in (*START, "coulomb", "friction_root", "spring", "jerk", "drag")
}
NOISE = 0.5


def force_of(*names: str, noise: float = NOISE, seed: int = 1) -> np.ndarray:
    made = noise * np.random.default_rng(seed).standard_normal(400)
    return made + sum(TRUE[name] * COLUMNS[name] for name in names)


def chosen_of(force: np.ndarray, seconds: float = 40.0, positive: frozenset = frozenset()) -> list:
    return choose_terms(Regression(COLUMNS, force, START, positive), seconds)[0][len(START) :]


def test_only_what_predicts_earns_its_place() -> None:
    assert chosen_of(force_of(*START)) == []
    assert chosen_of(force_of(*START, "coulomb")) == ["coulomb"]
    chosen, steps, tried = choose_terms(Regression(COLUMNS, force_of(*TRUE), START), 40.0)
    assert chosen[2:] == ["coulomb", "spring"], "the simplest law first, though the spring is more"
    assert [one.term for one in steps] == ["linear", "coulomb", "spring"]
    assert steps[-1].held_out_rms == pytest.approx(NOISE, rel=0.1)  # 400 errors: to 3.5 %
    assert {one.term for one in tried} == {"friction_root", "jerk", "drag"}


def test_a_short_recording_must_be_told_more() -> None:
    """0.5 beside a noise of 0.5 takes 29 % of the error away: enough of 10 s, not of 1 s."""
    force = force_of(*START) + NOISE * COLUMNS["drag"]
    assert chosen_of(force, seconds=10.0) == ["drag"]
    assert chosen_of(force, seconds=1.0) == []


def test_what_makes_another_term_impossible_is_not_taken() -> None:
    force = force_of(*START, "spring")
    assert chosen_of(force) == ["spring"]
    assert chosen_of(force, positive=frozenset({"spring"})) == []


def test_a_term_that_others_already_say_is_none() -> None:
    columns = COLUMNS | {"spring": COLUMNS["mass"] * 1.5}
    force = force_of(*START) + 1e-3 * columns["spring"]
    chosen, _, tried = choose_terms(Regression(columns, force, START), 40.0)
    assert "spring" not in chosen and "spring" not in [one.term for one in tried]


def test_errors_hold_what_another_law_would_say() -> None:
    """A root that is nearly the sign predicts as well and gives another damping."""
    rng = np.random.default_rng(3)
    damping = COLUMNS["damping"]
    alike = COLUMNS | {"friction_root": COLUMNS["coulomb"] + 0.2 * damping}
    apart = COLUMNS | {"friction_root": rng.standard_normal(400)}
    force = force_of(*START, "coulomb", noise=1e-3)
    chosen = [*START, "coulomb"]
    value = np.array([TRUE[name] for name in chosen])
    moved = 0.2 * TRUE["coulomb"]  # of the damping, with the root instead
    left = between_sets(Regression(alike, force, START), chosen, value)
    assert 0.3 * moved < left[1] < moved
    assert np.all(between_sets(Regression(apart, force, START), chosen, value) < 1e-3)


def test_rests_are_left_out() -> None:
    """Half a second at rest within a count, between motions of a hundred."""
    t = 1e-3 * np.arange(2000)
    moving = (t < 0.7) | (t > 1.2)
    place = np.where(t < 0.7, t, np.where(t > 1.2, t - 0.5, 0.7))
    x = np.round(np.sin(2 * np.pi * place) / 0.01) * 0.01
    recording = bh.recording_from_arrays(np.ones(2000), x, 1e-3, encoder_resolution=0.01)
    found = at_rest(recording, cutoff_hz=20.0)
    edge = 50  # samples: a period of the cut-off
    inside = (t > 0.7 + edge * 1e-3) & (t < 1.2 - edge * 1e-3)
    assert np.all(found[inside])
    # The sine turns round in some samples of a count: at its crests nothing else is at rest.
    assert np.mean(found[moving]) < 0.3
