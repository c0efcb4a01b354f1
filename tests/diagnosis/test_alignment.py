"""A position written down before its command acts: less delay than none, and a limit too high."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis.base import alignment
from bayeshaptic.diagnosis.base.alignment import (
    LESS_DELAY,
    MOVED,
    perhaps_early,
    rows_of_one_sample,
    with_rows_moved,
)
from bayeshaptic.diagnosis.base.opened import opened
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.inference.choose import choose_model
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import build_model
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.join import join_recordings
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline
from bayeshaptic.report.objections import _less_delay_s
from bayeshaptic.rig import Bench, Multisine, WhiteNoise, simulate

NOISE = WhiteNoise(0.05, 200.0, 0.7, 10.0)


def recorded(
    bench: Bench, early: int, excitation: WhiteNoise | Multisine = NOISE, seed: int = 3
) -> Recording:
    made = simulate(bench, excitation, seed=seed)
    length = len(made.force) - early
    return recording_from_arrays(
        made.force[:length],
        made.position[early:],
        bench.period_s,
        force_unit="Nm",
        position_unit="rad",
    )


@pytest.mark.parametrize(("delay_s", "status"), [(None, "untrusted"), (150e-6, "caution")])
def test_rows_are_moved_and_only_a_told_delay_says_by_how_many(
    delay_s: float | None, status: str
) -> None:
    bench = Bench.from_device("phantom")
    closed = close_loop(recorded(bench, 1), "free", hidden=False, delay_s=delay_s)
    said = headline(closed)
    assert said.status == status
    assert any("written down before" in text or "one sample before" in text for text in _of(said))
    low, high = closed.analysis.limit.quantile(0.005), closed.analysis.limit.quantile(0.995)
    assert low < bench.true_critical_stiffness() < high


def test_what_the_model_lacks_is_found_in_moved_rows() -> None:
    # Unmoved this one was explained by five effects, with a stiffness 25 times the limit.
    bench = Bench.from_device("phantom").with_effect("second_mode", frequency_hz=60.0)
    closed = close_loop(recorded(bench, 1), "free", hidden=False, delay_s=150e-6)
    assert [effect.name for effect in closed.effects] == ["second_mode"]
    stiffness = headline(closed).stiffness
    assert stiffness is not None and stiffness < bench.true_critical_stiffness()


@pytest.mark.parametrize("delay_s", [None, 150e-6, 450e-6])
def test_rows_of_one_sample_stay_whatever_the_model_lacks_and_was_told(
    delay_s: float | None,
) -> None:
    bench = Bench.from_device("phantom").with_effect("second_mode", frequency_hz=60.0)
    found = opened(recorded(bench, 0), "free", Options(delay_s=delay_s))
    model = build_model("free", None, delay_s, period_s=found.etfe.period_s)
    fit = least_squares(model, found.etfe)
    assert fit.misfits
    assert rows_of_one_sample(found, fit) is None


@pytest.mark.parametrize("delay_s", [None, 120e-6])
def test_a_mode_too_many_does_not_hide_it(delay_s: float | None) -> None:
    # A chain of three masses left nothing of rows as recorded: 5 times the limit, in green.
    bench = replace(Bench.from_device("phantom", False, "rigid"), delay_s=120e-6)
    found = opened(recorded(bench, 1), "auto", Options(delay_s=delay_s))
    choice = choose_model(found.etfe, None, delay_s)
    closed = close_loop(recorded(bench, 1), "auto", hidden=False, delay_s=delay_s)
    assert closed.model.name == "rigid" and choice.fit.model.name != "rigid"
    assert headline(closed).status == ("untrusted" if delay_s is None else "caution")
    low, high = closed.analysis.limit.quantile(0.005), closed.analysis.limit.quantile(0.995)
    assert low < bench.true_critical_stiffness() < high


def test_a_simpler_model_that_wants_a_delay_is_not_followed_into_moved_rows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    found = opened(recorded(Bench.from_device("phantom"), 0), "rigid", Options())
    fit = least_squares(build_model("rigid"), found.etfe)
    assert fit.misfits and "delay_s" not in fit.impossible
    asked: list[str] = []
    monkeypatch.setattr(alignment, "_below", lambda *known: asked.append("moved rows"))
    assert rows_of_one_sample(found, fit, to_noise=True) is None and not asked
    assert rows_of_one_sample(found, fit) is None and asked


def test_a_mode_above_half_the_sampling_rate_does_not_hide_it() -> None:
    # Its image was the lead that no delay leaves over: 5 times the limit, in green.
    bench = Bench.from_device("phantom").with_effect("extra_delay")
    closed = close_loop(recorded(bench, 1), "auto", hidden=False)
    assert headline(closed).status == "untrusted"
    low, high = closed.analysis.limit.quantile(0.005), closed.analysis.limit.quantile(0.995)
    assert low < bench.true_critical_stiffness() < high


def test_two_samples_are_two() -> None:
    found = opened(recorded(Bench.from_device("phantom"), 2), "free", Options())
    fit = least_squares(build_model("free", period_s=found.etfe.period_s), found.etfe)
    moved = rows_of_one_sample(found, fit)
    assert moved is not None
    recording, notice = moved
    assert recording.samples == found.etfe.recording.samples - 2  # type: ignore[union-attr]
    assert notice.topic == MOVED and "2 samples before" in notice.text


def test_a_period_less_of_a_force_that_repeats_is_no_better_fit() -> None:
    # It begins at rest: the first of its periods is unlike the other, and a row less drops it.
    bench = Bench.from_device("phantom").with_effect("coulomb_friction", force=0.005)
    found = opened(recorded(bench, 0, Multisine(0.05, 2.0, 150.0, 2.0, 2)), "free", Options())
    fit = least_squares(build_model("free", period_s=found.etfe.period_s), found.etfe)
    assert fit.misfits
    assert rows_of_one_sample(found, fit) is None


def test_a_force_that_repeats_shows_it_as_well() -> None:
    bench = Bench.from_device("phantom")
    found = opened(recorded(bench, 1, Multisine(0.05, 2.0, 150.0, 2.0, 6)), "free", Options())
    fit = least_squares(build_model("free", period_s=found.etfe.period_s), found.etfe)
    moved = rows_of_one_sample(found, fit)
    assert moved is not None and "one sample before" in moved[1].text


@pytest.mark.parametrize(("late", "delay_s", "noted"), [(1, 150e-6, True), (0, 50e-6, False)])
def test_a_whole_period_more_than_was_told_may_be_the_logger(
    late: int, delay_s: float, noted: bool
) -> None:
    bench = Bench.from_device("phantom")
    made = simulate(bench, NOISE, seed=3)
    length = len(made.force) - late
    recording = recording_from_arrays(
        made.force[late:],
        made.position[:length],
        bench.period_s,
        force_unit="Nm",
        position_unit="rad",
    )
    closed = close_loop(recording, "free", hidden=False, delay_s=delay_s)
    assert [effect.name for effect in closed.effects] == ["extra_delay"]
    told = [n for n in closed.analysis.notices if "written down one sample late" in n.text]
    assert bool(told) == noted
    assert headline(closed).status == "safe"


@pytest.mark.parametrize("told_s", [1.2e-3, 0.4e-3])
def test_less_delay_than_was_told_gets_no_stiffness(told_s: float) -> None:
    """A sample early, of a loop of more than one: it had 2.4 times the limit, "explained"."""
    bench = replace(Bench.from_device("phantom"), delay_s=1.2e-3)
    closed = close_loop(recorded(bench, 1), "free", hidden=False, delay_s=told_s)
    told = headline(closed)
    early = "less delay than was told" in told.sentence
    assert early == (told_s == bench.delay_s) and (told.stiffness is None) == early


def test_half_a_period_less_than_was_told_is_another_instant() -> None:
    """As between two commands, or integrated again; a quarter of a period may be a wrong number."""
    draws = np.random.default_rng(0).normal(0.0, 0.03e-3, (4000, 1))
    for less_s, said in ((0.5e-3, True), (0.35e-3, True), (0.25e-3, False), (0.0, False)):
        analysis: Any = SimpleNamespace(
            model=SimpleNamespace(names=("extra_delay_s",)),
            etfe=SimpleNamespace(period_s=1e-3),
            sampled=True,
            posterior=SimpleNamespace(draws=draws - less_s),
        )
        assert (_less_delay_s(analysis) is not None) == said


@pytest.mark.parametrize(
    ("told_s", "model"), [(1e-3, "rigid"), (1.5e-3, "rigid"), (1.5e-3, "free")]
)
def test_less_delay_shows_where_nothing_is_left_but_noise(told_s: float, model: str) -> None:
    # The chosen model itself leaves less with any delay, or a simpler one explains as much.
    bench = replace(Bench.from_device("phantom", False, "rigid"), delay_s=1e-3)
    made = simulate(bench, NOISE, seed=3)
    noise = 6 * bench.encoder_resolution * np.random.default_rng(0).standard_normal(10_000)
    recording = recording_from_arrays(
        made.force, made.position + noise, 1e-3, force_unit="Nm", position_unit="rad"
    )
    found = opened(recording, model, Options(delay_s=told_s))
    tried = {
        name: least_squares(build_model(name, None, told_s), found.etfe)
        for name in ("rigid", model)
    }
    assert not any(fit.misfits for fit in tried.values())
    fit = tried.pop(model)
    assert bool(perhaps_early(found, fit, tried.values())) == (told_s > bench.delay_s)


def test_every_piece_is_moved_by_itself() -> None:
    one, other = (
        recording_from_arrays(force, 2 * force, 1e-3, force_unit="N", position_unit="m")
        for force in (np.arange(600.0), np.arange(600.0) + 1)
    )
    moved = with_rows_moved(join_recordings([one, other]), 2)
    assert moved.joints == (598,) and moved.samples == 1196
    for piece in moved.pieces:
        assert np.array_equal(2 * piece.force, piece.position + 4)


def _of(said: object) -> tuple[str, ...]:
    return (said.sentence, *said.details)  # type: ignore[attr-defined]


def smoothed(bench: Bench, mean_of: int) -> Recording:
    """With the mean of so many commands in the record, and the last of them at the motor."""
    made = simulate(bench, NOISE, seed=3)
    force = np.convolve(made.force, np.full(mean_of, 1 / mean_of))[: len(made.force)]
    return recording_from_arrays(
        force, made.position, bench.period_s, force_unit="Nm", position_unit="rad"
    )


# As chosen; a mode in the base model that was asked for; an effect that was found.
@pytest.mark.parametrize(
    ("device", "model", "mean_of"),
    [("rigid", "auto", 1), ("rigid", "auto", 2), ("rigid", "free", 2), ("free", "free", 2)],
)
def test_a_mode_that_only_leads_does_not_hide_a_command_that_was_smoothed(
    device: str, model: str, mean_of: int
) -> None:
    # With the loop's own delay told a mode damped beyond measure stood for the lead, in green.
    bench = replace(Bench.from_device("phantom", False, device), delay_s=1.5e-3)
    closed = close_loop(smoothed(bench, mean_of), model, hidden=False, delay_s=bench.delay_s)
    warned = any(notice.topic == LESS_DELAY for notice in closed.analysis.notices)
    said = headline(closed)
    assert warned == (mean_of > 1) == (said.status == "untrusted")
    if warned:
        assert "less delay than was told" in said.sentence
        assert closed.analysis.limit.quantile(0.05) > bench.true_critical_stiffness()


@pytest.mark.parametrize(("mean_of", "effect"), [(3, None), (1, "second_mode")])
def test_a_mean_that_filters_too_is_less_delay_and_a_mode_is_none(
    mean_of: int, effect: str | None
) -> None:
    """A hand and a mode stood for a mean of three commands: twice the limit, in green."""
    bench = replace(Bench.from_device("phantom", False), delay_s=1.5e-3)
    bench = bench.with_effect(effect, frequency_hz=60.0) if effect else bench
    found = opened(smoothed(bench, mean_of), "free", Options(delay_s=bench.delay_s))
    fit = least_squares(build_model("free", None, bench.delay_s), found.etfe)
    assert fit.misfits and bool(perhaps_early(found, fit, [fit])) == (mean_of > 1)
