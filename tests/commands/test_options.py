"""How `analyse` and `close_loop` are called: one order, options by name, a path for a recording."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

import bayeshaptic as bh
from bayeshaptic.commands.options import descriptions
from bayeshaptic.diagnosis.base.asked import base_model, measurement_of
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.numerics.spending import BUDGET_S

STATISTICS = Path(__file__).parents[2] / "docs" / "statistics.md"
RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "phantom-free.csv.gz"


def test_help_is_whole_without_docstrings(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of ``python -OO``, or PYTHONOPTIMIZE=2."""
    known = descriptions(Options)
    monkeypatch.setattr(Options, "__doc__", "Options(delay_s: float | None = None)")  # dataclasses'
    assert known["seed"] and descriptions(Options) == known


@pytest.mark.parametrize(
    ("arguments", "options", "words"),
    [
        (("grasped", "a recording"), {}, "no such file"),
        ((3.0,), {}, "not float; see bayeshaptic.read_recording"),
        (("a.csv",), {"dealy_s": 0.0}, "no option 'dealy_s' .did you mean 'delay_s'"),
        (("a.csv",), {"zzz": 1}, "no option 'zzz'; there are device, delay_s"),
        (("a.csv", "free"), {"device": "nothing"}, "nothing"),
    ],
)
def test_what_cannot_be_is_said_in_one_line(arguments, options, words) -> None:
    for function in (bh.analyse, bh.close_loop):
        with pytest.raises(bh.InputError, match=words) as caught:
            function(*arguments, **options)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("function", [bh.analyse, bh.close_loop])
@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"prior": {"kcc": bh.LogNormal(5e4, 1.0)}}, "no model has a parameter 'kcc'.*mean 'kc'"),
        ({"prior": {"zzz": bh.LogNormal(5e4, 1.0)}}, "'zzz'; there are m, b, .*, delay_s"),
        ({"effects": {"backlsh": 0.1}}, "no effect 'backlsh' .did you mean 'backlash'"),
    ],
)
def test_a_name_that_would_do_nothing_is_refused(function, options, words) -> None:
    """The misspelt prior of a model that was to be chosen was silently of no effect."""
    with pytest.raises(bh.InputError, match=words):
        function(RECORDING, **options)


@pytest.mark.parametrize("function", [bh.analyse, bh.close_loop])
@pytest.mark.parametrize(
    "options",
    [
        {"delay_s": 200.0},
        {"delay_s": 2.0, "modes": 1},
        {"delay_s": 2e-4, "delay_sd_s": 200.0},
        {"device": replace(bh.load_device("phantom"), delay_s=2.0)},
    ],
)
def test_a_delay_of_milliseconds_in_seconds_is_refused(function, options) -> None:
    """It filled the memory, or did not come to an end."""
    with pytest.raises(bh.InputError, match="sampling periods of 0.001 s, and 100 are the most"):
        function(RECORDING, **options)
    with pytest.raises(bh.InputError, match="a loop delay of 2 s is 2,000 sampling periods"):
        function(RECORDING, bh.free("phantom", delay_s=2.0))
    with pytest.raises(bh.InputError, match="a delay_sd_s says nothing without delay_s"):
        function(RECORDING, delay_sd_s=1e-5)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("[prior]\nkcc = {median = 5e4, log_sd = 1.0}\n", "'kcc' .did you mean 'kc'"),
        ("[effects]\nbacklsh = 0.1\n", "'backlsh' .did you mean 'backlash'"),
    ],
)
def test_a_study_is_refused_before_a_recording_is_read(tmp_path: Path, table, words) -> None:
    study = tmp_path / "study.toml"
    named = f"[[recording]]\nfile = '{tmp_path}/a.csv'\n"
    study.write_text(f"[device]\nname = 'phantom'\n{table}{named}", "utf-8")
    (tmp_path / "a.csv").touch()
    with pytest.raises(bh.InputError, match=words):
        bh.analyse_study(bh.read_study(study), close_loop=False)


def test_priors_of_held_and_free_devices_go_with_either() -> None:
    """A study of both has one table."""
    hand = {
        "mh": bh.LogNormal(1.0, 1.0),
        "m3": bh.LogNormal(1.0, 1.0),
        "delay_s": bh.HalfNormal(1e-3),
    }
    for held in (None, True, False):
        assert base_model("auto", Options(prior=hand, held=held)) == "auto"


def test_the_budget_that_the_help_says_is_the_one_that_holds() -> None:
    """Three commands said 60 where it was 40."""
    said = descriptions(Options)["budget_s"]
    assert said.endswith(f"by default {Options().budget_s:g}") and Options().budget_s == BUDGET_S
    (told,) = re.findall(r"`--budget SECONDS` \(default (\d+)\)", STATISTICS.read_text("utf-8"))
    assert float(told) == BUDGET_S


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
    joined = bh.join_recordings([RECORDING, recording.part(0, 9000)])
    assert joined.joints == (recording.samples,)
    with pytest.raises(bh.InputError, match="no such file"):
        bh.measure_relay(tmp_path / "a.csv")
