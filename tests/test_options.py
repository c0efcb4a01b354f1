"""How `analyse` and `close_loop` are called: one order, options by name, a path for a recording."""

from __future__ import annotations

from pathlib import Path

import pytest

import bayeshaptic as bh
from bayeshaptic.diagnosis.base.asked import measurement_of
from bayeshaptic.diagnosis.options import Options

RECORDING = Path(__file__).parents[1] / "data" / "recordings" / "phantom-free.csv.gz"


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (("grasped", "a recording"), {}, "no such file"),
        ((3.0,), {}, "not float; see bayeshaptic.read_recording"),
        (("a.csv",), {"dealy_s": 0.0}, "no option 'dealy_s'; did you mean delay_s?"),
        (("a.csv",), {"zzz": 1}, "no option 'zzz'; there are device, delay_s"),
        (("a.csv", "free"), {"device": "nothing"}, "nothing"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, options, words) -> None:
    for function in (bh.analyse, bh.close_loop):
        with pytest.raises(bh.InputError, match=words) as caught:
            function(*arguments, **options)
        assert "\n" not in str(caught.value)


def test_the_measurement_comes_first() -> None:
    recording = bh.read_recording(RECORDING)
    with pytest.raises(bh.InputError, match="the measurement comes first"):
        bh.close_loop("free", recording)


def test_a_path_is_read_with_what_the_device_says() -> None:
    options = Options(device="phantom")
    read = measurement_of(str(RECORDING), "free", options)
    assert read.encoder_resolution == bh.load_device("phantom").encoder_resolution


def test_stages_share_the_progress() -> None:
    seen = []
    options = Options(progress=lambda share, word: seen.append((share, word)))
    options.within(0.2, 0.6).within(0.5, 1.0).report(0.5, "half of it")
    assert seen == [(pytest.approx(0.5), "half of it")]


def test_a_path_goes_where_a_recording_does(tmp_path: Path) -> None:
    recording = bh.read_recording(RECORDING)
    found = bh.estimate_etfe(str(RECORDING), band_hz=(1, 25))
    assert (found.value == bh.estimate_etfe(recording, band_hz=(1, 25)).value).all()
    assert bh.join_recordings([RECORDING, recording]).joints == (recording.samples,)
    with pytest.raises(bh.InputError, match="no such file"):
        bh.measure_relay(tmp_path / "a.csv")
