"""A position that was high-passed before it was written down: what the filter did is no damping."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from bayeshaptic.diagnosis.base.begun import begin
from bayeshaptic.diagnosis.base.high_passed import TOPIC, perhaps_high_passed
from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import Notice
from bayeshaptic.recordings.from_arrays import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.headline import headline
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.rig import Bench, WhiteNoise, simulate

NOISE = WhiteNoise(0.05, 200.0, 0.7, 12.0)
COUNT = 1.7e-6


def recorded(
    corner_hz: float = 0.0, order: int = 1, count: float = 0.0, held: bool = False
) -> Recording:
    """Of an encoder without counts, high-passed, in counts of the file."""
    bench = Bench.from_device("phantom", held, encoder_resolution=1e-9)
    made = simulate(bench, NOISE, seed=4)
    position = made.position
    if corner_hz:
        filtering = butter(order, corner_hz, "high", fs=1 / bench.period_s, output="sos")
        position = sosfilt(filtering, position - position[0])
    position += 1e-7 * np.random.default_rng(5).standard_normal(len(position))
    if count:
        position = count * np.round(position / count)
    signals = made.force, position, bench.period_s
    return recording_from_arrays(*signals, force_unit="Nm", position_unit="rad")


def asked(recording: Recording, held: bool | None = None) -> tuple[Notice, ...]:
    begun = begin(recording, "auto", Options(held=held))
    return perhaps_high_passed(begun.fit, begun.etfe, begun.choice, recording)


@pytest.mark.parametrize(("corner_hz", "order"), [(0.2, 1), (0.8, 1), (0.5, 2)])
def test_a_filter_is_no_hand(corner_hz: float, order: int) -> None:
    (notice,) = asked(recorded(corner_hz, order))
    assert (notice.topic, notice.level) == (TOPIC, "warning")


def test_no_stiffness_follows() -> None:
    closed = close_loop(recorded(0.8), hidden=False)
    said = headline(closed)
    assert said.status == "untrusted" and "high-passed" in said.sentence
    steps = next_steps(said, closed)
    assert "as it is read" in steps[0].text and steps[1].command.endswith("--held yes")
    assert "--held yes" in said.sentence
    truth = Bench.from_device("phantom").true_critical_stiffness()
    assert closed.analysis.limit.quantile(0.05) > 1.3 * truth  # what it is there to prevent


def test_a_filter_beside_a_hand_is_seen_too() -> None:
    assert asked(recorded(0.5, 2, held=True), held=True)


def test_who_said_that_nobody_holds_it_is_not_told_to_say_so() -> None:
    said = headline(close_loop(recorded(0.8), held=False, hidden=False))
    assert "high-passed" in said.sentence and "--held" not in said.sentence


@pytest.mark.parametrize("held", [False, True])
def test_what_was_not_filtered_is_not_doubted(held: bool) -> None:
    assert not asked(recorded(held=held))


def test_whole_counts_were_not_filtered_but_decimals_may_be() -> None:
    assert not asked(recorded(0.8, count=COUNT))
    assert asked(recorded(0.8, count=1e-6))


def test_counts_stay_counts_when_something_is_taken_off_them() -> None:
    begun = begin(recorded(0.8), "auto", Options())
    assert not perhaps_high_passed(begun.fit, begun.etfe, begun.choice, recorded(0.8, count=COUNT))


def test_a_damper_is_no_filter() -> None:
    """A mass without damping behind a high-pass is one with damping, to the last digit."""
    bench = Bench.from_device("phantom", False, "rigid", encoder_resolution=1e-9)
    made = simulate(bench, WhiteNoise(0.05, 200.0, 0.7, 8.0), seed=1)
    position = made.position + 1e-7 * np.random.default_rng(6).standard_normal(len(made.force))
    signals = made.force, position, bench.period_s
    recording = recording_from_arrays(*signals, force_unit="Nm", position_unit="rad")
    begun = begin(recording, "auto", Options())
    assert begun.choice is not None
    larger = begun.choice.candidates["free"].fit  # the mass has lost a mode that it does not have
    assert not perhaps_high_passed(larger, begun.etfe, begun.choice, recording)
