"""The command line: what it says, where it writes, and how it fails."""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import signal
import stat
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_analysis import fake_analysis

import bayeshaptic
from bayeshaptic import cli
from bayeshaptic.commands import COMMANDS
from bayeshaptic.commands.simulate import parse_effect
from bayeshaptic.commands.talk import Talk
from bayeshaptic.devices import device_names
from bayeshaptic.diagnosis.analyse import analyse
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError
from bayeshaptic.jobs import batch, recording as recording_job
from bayeshaptic.report import summary_json
from bayeshaptic.report.headline import Headline
from bayeshaptic.report.reported import Reported
from bayeshaptic.report.walls.section import table_of
from bayeshaptic.study import analysis as study_analysis

Run = Callable[..., tuple[int, str, str]]
# The quickest analysis: two parameters, below the first mode.
RIGID = ("--model", "rigid", "--device", "phantom", "--band", "1,25", "--no-loop")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """The command line in an empty folder: exit status, stdout and stderr."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("BAYESHAPTIC_DEBUG", raising=False)

    def call(*arguments: str | Path) -> tuple[int, str, str]:
        try:
            status = cli.main([str(argument) for argument in arguments])
        except SystemExit as stop:
            status = int(stop.code or 0)
        out, err = capfd.readouterr()
        return status, out, err

    return call


@pytest.fixture(scope="module")
def phantom(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five seconds of the PHANToM without a hand."""
    path = tmp_path_factory.mktemp("recordings") / "phantom.csv"
    assert cli.main(["simulate", "phantom", "--seconds", "5", "-o", str(path), "--quiet"]) == 0
    return path


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Few draws and no figures: for tests that are about other things."""

    def write(result: Any, folder: Path, origin: Any = None) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "summary.json").write_text(summary_json(result, origin))
        (folder / "report.html").write_text("<!DOCTYPE html>bayeshaptic")
        return folder / "report.html"

    monkeypatch.setattr(recording_job, "analyse", partial(analyse, ess=50))
    monkeypatch.setattr(study_analysis, "analyse", lambda *a, **b: analyse(*a, **b | {"ess": 50}))
    monkeypatch.setattr(
        "bayeshaptic.report.study.write.table_of",
        partial(table_of, draws=60),
    )
    monkeypatch.setattr(recording_job, "write_report", write)


def columns(path: Path) -> dict[str, np.ndarray]:
    header, *rows = path.read_text().splitlines()
    return dict(zip(header.split(","), np.loadtxt(rows, delimiter=",").T, strict=True))


def write_columns(path: Path, **values: Any) -> Path:
    rows = zip(*values.values(), strict=True)
    lines = [",".join(f"{v:.12g}" if not isinstance(v, str) else v for v in row) for row in rows]
    path.write_text("\n".join([",".join(values), *lines, ""]))
    return path


# --- help ---------------------------------------------------------------------------------------


def test_help_lists_every_command(run: Run) -> None:
    status, out, err = run("--help")
    assert status == 0 and not err
    for command in COMMANDS:
        assert command.NAME in out and command.SUMMARY in out


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.NAME)
def test_help_of_a_command_says_what_defaults_and_examples(run: Run, command: Any) -> None:
    status, out, _ = run(command.NAME, "--help")
    assert status == 0
    assert command.DESCRIPTION in out and command.EXAMPLES in out
    assert max(len(line) for line in out.splitlines()) <= 100
    parser = cli.build_parser()
    for line in command.EXAMPLES.strip().splitlines():  # every example is understood
        program, *arguments = shlex.split(line)
        assert program == "bayeshaptic" and parser.parse_args(arguments).run is command.run


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.NAME)
def test_every_option_has_help(command: Any) -> None:
    parser = cli._Parser()
    command.add_arguments(parser)
    assert all(action.help not in (None, "", argparse.SUPPRESS) for action in parser._actions)
    told = [str(action.help) for action in parser._actions if action.dest == "device"]
    takes_a_device = {"report", "batch", "population", "relay", "simulate"}
    assert len(told) == (command.NAME in takes_a_device)
    assert all(name in text for text in told for name in device_names())


def test_without_a_command_the_help_is_shown(run: Run) -> None:
    status, out, err = run()
    assert status == 2 and not out and "commands:" in err


def test_version(run: Run) -> None:
    assert run("--version") == (0, f"bayeshaptic {bayeshaptic.__version__}\n", "")


def test_the_package_runs_as_a_module() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bayeshaptic", "--version"], capture_output=True, text=True
    )
    assert done.returncode == 0 and bayeshaptic.__version__ in done.stdout


# --- options that cannot be ---------------------------------------------------------------------


def only_line(err: str) -> str:
    assert "Traceback" not in err
    (line,) = err.strip().splitlines()
    return line


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["repotr", "a.csv"], "repotr"),
        (["report"], "RECORDING_OR_STUDY"),
        (["report", "a.csv", "--band", "5"], "LOW,HIGH"),
        (["report", "a.csv", "--band", "200,5"], "LOW < HIGH"),
        (["report", "a.csv", "--band", "a,5"], "'a' is not a number"),
        (["report", "a.csv", "--band", "-1,5"], "LOW < HIGH"),
        (["report", "a.csv", "--delay-s", "-1e-3"], "must not be negative"),
        (["report", "a.csv", "--delay-s", "nan"], "finite"),
        (["report", "a.csv", "--period-s", "0"], "above zero"),
        (["report", "a.csv", "--model", "gasped"], "gasped"),
        (["report", "a.csv", "--seed", "1.5"], "whole number"),
        (["report", "a.csv", "--unknown"], "--unknown"),
        (["batch", "a.toml", "--workers", "0"], "above zero"),
        (["batch", "a.toml", "--workers", "2", "--dask", "tcp://x:1"], "not allowed with"),
        (["simulate", "phantom"], "-o"),
        (["simulate", "phantom", "-o", "a.csv", "--held", "--free"], "not allowed with"),
        (["simulate", "phantom", "-o", "a.csv", "--seconds", "-3"], "above zero"),
    ],
)
def test_wrong_options_are_one_line(run: Run, arguments: list[str], part: str) -> None:
    status, out, err = run(*arguments)
    assert status == 2 and not out
    assert part in only_line(err) and "--help" in err


# --- input that cannot be used ------------------------------------------------------------------


def spoil(recording: Path, target: Path, how: str) -> None:
    """Write the recording to `target` with one thing wrong."""
    data = columns(recording)
    names = list(data)
    time_s, force, position = names
    rng = np.random.default_rng(0)
    if how == "empty":
        target.write_text("")
        return
    if how == "missing column":
        del data[position]
    elif how == "NaN":
        data[force][123] = np.nan
    elif how == "text in a number":
        data[position] = data[position].astype("U25")
        data[position][77] = "oops"
    elif how == "non-uniform time":
        data[time_s] = np.cumsum(rng.uniform(0.1e-3, 4e-3, len(data[time_s])))
    elif how == "constant force":
        data[force][:] = 0.5
    elif how == "50 samples":
        data = {name: values[:50] for name, values in data.items()}
    elif how == "swapped columns":
        data[force], data[position] = data[position], data[force]
    elif how == "zero variance":
        data[position][:] = 0.01
    elif how == "header only":
        data = {name: values[:0] for name, values in data.items()}
    elif how == "cut off":
        whole = recording.read_text()
        target.write_text(whole[: len(whole) // 2].rsplit(",", 1)[0] + "\n")
        return
    write_columns(target, **data)


@pytest.mark.parametrize(
    ("how", "part"),
    [
        ("empty", "empty"),
        ("header only", "no rows"),
        ("missing column", "angle_rad"),
        ("NaN", "row 124"),
        ("text in a number", "oops"),
        ("non-uniform time", "time"),
        ("constant force", "constant"),
        ("50 samples", "too few"),
        ("swapped columns", "swapped"),
        ("zero variance", "never changes"),
        ("cut off", "it is the last one, where the file was cut off"),
    ],
)
def test_bad_recordings_are_one_line_and_leave_nothing(
    run: Run, phantom: Path, tmp_path: Path, how: str, part: str
) -> None:
    bad = tmp_path / "bad.csv"
    spoil(phantom, bad, how)
    status, out, err = run("report", bad, "-o", "out")
    assert status == 2 and not out
    assert part in only_line(err)
    assert err.startswith("bayeshaptic: error: ")
    assert sorted(os.listdir(tmp_path)) == ["bad.csv"]


def test_units_wrong_by_a_thousand_are_a_warning(
    run: Run, quick: None, phantom: Path, tmp_path: Path
) -> None:
    data = columns(phantom)
    data["angle_rad"] *= 1000
    milli = write_columns(tmp_path / "milli.csv", **data)
    status, out, _ = run("report", milli, *RIGID)
    assert status == 0
    assert re.search(r"warning: .*slip of units", out), out


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["report", "missing.csv"], "no such file"),
        (["report", "missing.toml"], "no such file"),
        (["report", "."], "folder"),
        (["report", "{phantom}", "--device", "fantom"], "did you mean 'phantom'?"),
        (["report", "{phantom}", "--device", "lhifam"], "rotational"),
        (["report", "{phantom}", "--columns", "force=nothing"], "nothing"),
        (["report", "{phantom}", "--band", "600,700"], "Hz"),
        (["simulate", "fantom", "-o", "a.csv"], "did you mean 'phantom'?"),
        (["simulate", "phantom", "-o", "a.wav"], ".csv"),
        (["simulate", "phantom", "-o", "no/such/folder/a.csv"], "no such folder"),
        (["simulate", "phantom", "-o", "."], "folder"),
        (["simulate", "phantom", "-o", "a.csv", "--effect", "magic"], "coulomb_friction"),
        (["simulate", "phantom", "-o", "a.csv", "--effect", "extra_delay=x"], "FIELD:VALUE"),
        (["batch", "a/same.csv", "a/same.mat"], "rename one"),
        (["relay", "{phantom}", "--model", "free"], "give --device, too"),
        (["inspect", "{phantom}", "--write", "study"], "a name that ends in .toml"),
        (["inspect", "{phantom}", "--png", "no/such/a.png"], "no/such: no such folder"),
        (["explain", "feedbck"], "did you mean 'feedback'?"),
    ],
)
def test_wrong_input_is_one_line(
    run: Run, phantom: Path, tmp_path: Path, arguments: list[str], part: str
) -> None:
    filled = [argument.replace("{phantom}", str(phantom)) for argument in arguments]
    status, out, err = run(*filled)
    assert status == 2 and not out
    assert part in only_line(err)
    assert not os.listdir(tmp_path)


def test_an_output_that_is_a_file_is_refused_before_any_work(
    run: Run, phantom: Path, tmp_path: Path
) -> None:
    (tmp_path / "out").write_text("mine")
    for folder in ("out", "out/deeper"):
        status, _, err = run("report", phantom, "-o", folder)
        assert status == 2 and "is a file" in only_line(err)
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="everything is permitted to root"
)
def test_a_folder_without_permission_is_one_line(run: Run, phantom: Path, tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir()
    locked.chmod(stat.S_IRUSR | stat.S_IXUSR)
    status, _, err = run("report", phantom, "-o", locked / "out")
    locked.chmod(stat.S_IRWXU)
    assert status == 2 and "permission" in only_line(err)


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="no /proc, which takes no file")
def test_a_folder_that_takes_no_file_is_refused_before_any_work(run: Run, phantom: Path) -> None:
    status, _, err = run("report", phantom, "-o", "/proc/out")
    assert status == 2 and "/proc: cannot write there" in only_line(err)


# --- errors that nobody expects -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("raised", "status", "part"),
    [
        (KeyboardInterrupt(), 130, "interrupted"),
        (
            PermissionError(13, "Permission denied", "/some/file"),
            2,
            "/some/file: Permission denied",
        ),
        (OSError(28, "No space left on device"), 2, "error: No space left on device"),
        (InputError("line one\nline two"), 2, "error: line one line two"),
        (ZeroDivisionError("division by zero"), 1, "defect in bayeshaptic (ZeroDivisionError: "),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_whatever_is_raised_becomes_one_line(
    run: Run, monkeypatch: pytest.MonkeyPatch, raised: BaseException, status: int, part: str
) -> None:
    def fail(*_: Any) -> None:
        raise raised

    monkeypatch.setattr(batch, "report_source", fail)
    got, out, err = run("report", "a.csv")
    assert got == status and not out and part in only_line(err)
    if status in (1, 2):
        for arguments, debug in ((["--debug"], ""), ([], "1")):
            monkeypatch.setenv("BAYESHAPTIC_DEBUG", debug)
            got, _, err = run("report", "a.csv", *arguments)
            assert got == status and "Traceback" in err


def test_warnings_are_one_line_each(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    import warnings

    def warn(*_: Any) -> tuple[()]:
        with warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.warn("twice\nthe lines", bayeshaptic.BayeshapticWarning, stacklevel=1)
        return ()

    monkeypatch.setattr(batch, "report_source", warn)
    status, _, err = run("report", "a.csv")
    assert status == 0 and err == "bayeshaptic: warning: twice the lines\n"


# A shell's background processes ignore interrupts, and so would their children.
WAITING = """
import signal, sys, time
from bayeshaptic import cli
from bayeshaptic.jobs import batch

signal.signal(signal.SIGINT, signal.default_int_handler)

def wait(*_):
    print("working", flush=True)
    time.sleep(60)

batch.report_source = wait
sys.exit(cli.main(["report", "a.csv"]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for child processes on Windows")
def test_an_interrupt_ends_a_process_without_traceback(tmp_path: Path) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", WAITING],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            assert process.stdout is not None and process.stdout.readline() == "working\n"
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30)
        finally:
            process.kill()
    assert process.returncode == 130 and not out
    assert only_line(err) == "bayeshaptic: interrupted"
    assert not os.listdir(tmp_path)


# --- report -------------------------------------------------------------------------------------


def test_report_writes_everything_and_says_what_to_do(
    run: Run, phantom: Path, tmp_path: Path
) -> None:
    options = ("--device", "phantom", "--model", "free", "--no-loop", "-o", "out")
    status, out, err = run("report", phantom, *options)
    assert status == 0 and not err
    folder = tmp_path / "out"
    assert {"report.html", "summary.json", "posterior.nc"} <= set(os.listdir(folder))
    assert list(folder.glob("*.png"))
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["model"]["name"] == "free"
    # The file's own K_CR, 13.215 N m/rad, to within what five seconds can tell.
    assert summary["critical_stiffness"]["q50"] == pytest.approx(13.215, rel=0.02)
    first, *others = out.splitlines()
    assert first.startswith("phantom: ") and "N m/rad" in first
    assert others[-1] == f"  report: {folder / 'report.html'}" and len(others) <= 4


def test_no_recording_is_replaced_by_its_report(run: Run, phantom: Path, tmp_path: Path) -> None:
    recording = tmp_path / "limits.csv"
    content = phantom.read_bytes()
    recording.write_bytes(content)
    (tmp_path / "study.toml").write_text(
        '[device]\nname = "phantom"\n[[recording]]\nfile = "limits.csv"\n'
    )
    for source in ("limits.csv", "study.toml"):
        status, out, err = run("report", source, *RIGID, "-o", ".")
        assert status == 2 and not out
        assert "limits.csv: the report has a file of this name" in only_line(err)
    assert recording.read_bytes() == content
    status, _, err = run("report", "limits.csv", "-o", "")
    assert status == 2 and "the name is empty" in err


@pytest.mark.usefixtures("quick")
class TestReport:
    """`report` and `batch` with quick analyses."""

    def test_default_folder_quiet_and_the_same_seed(
        self, run: Run, phantom: Path, tmp_path: Path
    ) -> None:
        status, out, _ = run("report", phantom, *RIGID, "--seed", "3")
        assert status == 0 and out
        assert run("report", phantom, *RIGID, "--seed", "3", "-o", "b", "--quiet") == (0, "", "")
        first, second = (
            json.loads((tmp_path / folder / "summary.json").read_text())
            for folder in ("phantom-report", "b")
        )
        for summary in first, second:
            del summary["posterior"]["seconds"]
            del summary["provenance"]["command"], summary["provenance"]["seconds"]
        assert first == second

    @pytest.mark.parametrize("extra", [["--no-loop"], []])
    def test_options_reach_the_analysis(
        self, run: Run, phantom: Path, monkeypatch: pytest.MonkeyPatch, extra: list[str]
    ) -> None:
        seen: dict[str, Any] = {}

        def spy(measurement: Any, model: str, options: Options) -> None:
            seen.update(vars(options), measurement=measurement, model=model)
            raise InputError("seen enough")

        monkeypatch.setattr(recording_job, "analyse" if extra else "close_loop", spy)
        status, _, err = run(
            "report", phantom, "--model", "free", "--device", "phantom", "--delay-s", "2e-4",
            "--delay-sd-s", "1e-5", "--band", "1,150", "--encoder-resolution", "1e-3",
            "--seed", "7", "--held", "no", *extra,
        )  # fmt: skip
        assert status == 2 and "seen enough" in err
        assert seen["model"] == "free" and seen["device"].name == "phantom" and seen["seed"] == 7
        assert (seen["delay_s"], seen["delay_sd_s"]) == (2e-4, 1e-5)
        assert seen["band_hz"] == (1.0, 150.0)
        assert seen["measurement"].encoder_resolution == 1e-3
        assert seen["measurement"].device == "phantom" and seen["held"] is False

    @pytest.fixture
    def three(self, phantom: Path, tmp_path: Path) -> Path:
        """A study of which one recording is bad and two have the same name."""
        (tmp_path / "bad.csv").write_text("time_s,torque_nm,angle_rad\n0,1,oops\n")
        (tmp_path / "again").mkdir()
        # One that was written anew: a copy of a file would be refused.
        (tmp_path / "again" / phantom.name).write_bytes(phantom.read_bytes() + b"\n")
        (tmp_path / "study.toml").write_text(
            f"""
            [device]
            name = "phantom"
            [prior]
            m1 = {{ median = 0.9e-3, log_sd = 0.2 }}
            [[recording]]
            file = "{phantom.as_posix()}"
            configuration = 0.25
            [[recording]]
            file = "bad.csv"
            level = 2
            [[recording]]
            file = "again/{phantom.name}"
            """
        )
        return tmp_path / "study.toml"

    def test_study(self, run: Run, three: Path, tmp_path: Path) -> None:
        status, out, err = run("report", three, "--no-loop", "--workers", "1", "--allow-outside")
        folder = tmp_path / "study-report"
        assert status == 1
        assert "error: bad: " in only_line(err)
        assert out.count("report: ") == 3
        assert out.splitlines()[-1] == f"  report: {Path('study-report', 'report.html').resolve()}"
        assert {path.name for path in folder.iterdir() if path.is_dir()} == {
            "phantom-1",
            "phantom-2",
        }
        summary = json.loads((folder / "phantom-1" / "summary.json").read_text())
        assert summary["recording"]["configuration"] == 0.25
        assert summary["model"]["name"] == "free"  # nobody is named: nobody held it
        page = (folder / "report.html").read_text()
        assert 'href="phantom-1/report.html"' in page and 'href="phantom-2/report.html"' in page
        assert "bad failed" in page and "oops" in page
        limits = json.loads((folder / "limits.json").read_text())
        assert limits["device"] == "phantom" and limits["status"] == "caution"

    def test_population_alone(self, run: Run, three: Path, tmp_path: Path) -> None:
        status, out, err = run(
            "population", three, "--no-loop", "--workers", "1", "--allow-outside", "-o", "out"
        )
        assert status == 1 and "error: bad: " in only_line(err)
        assert out.splitlines()[-1] == f"  report: {tmp_path / 'out' / 'report.html'}"
        names = {path.name for path in (tmp_path / "out").iterdir()}
        assert {"report.html", "population.json"} <= names and "limits.json" not in names
        assert not [path for path in (tmp_path / "out").iterdir() if path.is_dir()]
        found = json.loads((tmp_path / "out" / "population.json").read_text())
        assert found["population"] is None and found["device_limit"]["safe"]["0.05"] > 0

    def test_a_study_of_nothing_usable_writes_nothing(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "bad.csv").write_text("time_s,torque_nm,angle_rad\n0,1,oops\n")
        (tmp_path / "study.toml").write_text(
            '[device]\nname = "phantom"\n[[recording]]\nfile = "bad.csv"\n'
        )
        for command in ("report", "population"):
            status, out, err = run(command, "study.toml", "--workers", "1")
            assert status == 1 and not out and "error: bad: " in only_line(err)
        assert sorted(os.listdir(tmp_path)) == ["bad.csv", "study.toml"]

    def test_a_population_needs_a_study(self, run: Run, phantom: Path) -> None:
        status, _, err = run("population", phantom)
        assert status == 2 and "a population needs a study (.toml)" in only_line(err)

    def test_reading_options_are_refused_for_a_study(self, run: Run, tmp_path: Path) -> None:
        (tmp_path / "study.toml").write_text("")
        status, _, err = run("report", "study.toml", "--period-s", "0.001")
        assert status == 2 and "--period-s is for a single recording" in only_line(err)

    def test_batch_goes_on_after_a_failure(self, run: Run, phantom: Path, tmp_path: Path) -> None:
        (tmp_path / "bad.csv").write_text("nothing\n")
        status, out, err = run("batch", "bad.csv", phantom, "--workers", "1", *RIGID)
        assert status == 1 and "bad.csv" in only_line(err)
        assert "phantom: " in out and f"reports: {tmp_path / 'reports'}" in out
        files = {"failed.csv", "index.csv", "index.html", "manifest.json"}
        assert set(os.listdir(tmp_path / "reports")) == {"phantom", *files}

    def test_measured_multisine(self, run: Run, measured: Callable[[str], Path]) -> None:
        """20 periods of a multisine on 11 to 250 Hz, motor current in, motor angle out."""
        path = measured("two_mass_bench/MultisineTypeA.mat")
        mapping = "time=time*1e-6,force=iq_refx[A],position=theta_mx[rad]"
        status, out, _ = run("report", path, "--columns", mapping, "--model", "free", "--no-loop")
        assert status == 0 and "Do not ship a stiffness" in out and "times the noise" in out
        summary = json.loads(Path("MultisineTypeA-report/summary.json").read_text())
        assert summary["recording"]["period_s"] == pytest.approx(1 / 2500)
        assert summary["recording"]["kind"] == "rotational"
        assert summary["etfe"]["period_lines"] == 240
        assert summary["etfe"]["frequency_hz"] == pytest.approx([11, 250])
        assert summary["critical_stiffness"]["unit"] == "A/rad"
        assert summary["least_squares"]["reduced_chi_square"] > 100

    def test_measured_closed_loop(self, run: Run, measured: Callable[[str], Path]) -> None:
        path = measured("emps/DATA_EMPS.mat")
        mapping = "time=t,force=vir*35.15[N],position=qm"
        status, out, _ = run("report", path, "--columns", mapping, "--model", "rigid", "--no-loop")
        assert status == 0 and "feedback" in out and "warning: The force was computed" in out
        summary = json.loads(Path("DATA_EMPS-report/summary.json").read_text())
        assert summary["recording"]["feedback"] is True


def test_what_is_said_of_each_recording(capsys: pytest.CaptureFixture[str]) -> None:
    head = Headline("safe", "Render walls of at most 1 N/m.", ())
    warnings = ("one", "two", "three", "four", "five")
    done = [
        Reported("a", Path("a.html"), head, "The model lacked a spring.", warnings),
        Reported("b", error="b.csv: empty"),
        Reported("c", error="what is wrong"),
    ]
    with Talk(quiet=False) as talk:
        assert talk.tell(done) == 2
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        "a: Render walls of at most 1 N/m.",
        "  The model lacked a spring.",
        "  warning: one",
        "  warning: two",
        "  warning: three",
        "  and 2 more in the report",
        "  report: a.html",
    ]
    assert err.splitlines() == [
        "bayeshaptic: error: b: b.csv: empty",
        "bayeshaptic: error: c: what is wrong",
    ]


# --- batch -------------------------------------------------------------------------------------


def test_no_dask_scheduler_is_one_line(run: Run, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="the dask extra is not installed")
    for address, part in (("nonsense", "no dask address"), ("tcp://127.0.0.1:9", "no dask sched")):
        status, _, err = run("batch", "a.csv", "--dask", address)
        assert status == 2 and part in only_line(err)


def test_without_dask_the_extra_is_named(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    status, _, err = run("batch", "a.csv", "--dask", "tcp://nowhere:1")
    assert status == 2 and "bayeshaptic[dask]" in only_line(err)


def test_batch_in_processes_reports_failures_of_each(run: Run, tmp_path: Path) -> None:
    for name in ("one.csv", "two.csv"):
        (tmp_path / name).write_text("")
    status, out, err = run("batch", "one.csv", "two.csv", "--workers", "2")
    assert status == 1
    assert sorted(line.split(": ")[2].rsplit("/", 1)[-1] for line in err.splitlines()) == [
        "one.csv",
        "two.csv",
    ]
    failed = (tmp_path / "reports" / "failed.csv").read_text()
    assert "one.csv" in failed and "two.csv" in failed


# --- simulate -----------------------------------------------------------------------------------


def test_simulate_is_repeatable_and_says_the_truth(run: Run, tmp_path: Path) -> None:
    for name, seed in (("a.csv.gz", "4"), ("b.csv.gz", "4"), ("c.csv.gz", "5")):
        status, out, err = run(
            "simulate", "lhifam", "--held", "--seconds", "2", "--seed", seed, "-o", name
        )
        assert status == 0 and not err
        assert out.startswith(f"{name}: 2000 samples every 1 ms; truth: grasped") and "N/m" in out
    a, b, c = (tmp_path / f"{name}.csv.gz" for name in "abc")
    assert a.read_bytes() == b.read_bytes() != c.read_bytes()


def test_simulate_options(run: Run) -> None:
    status, _, _ = run(
        "simulate", "phantom", "--excitation", "multisine", "--seconds", "3", "--force-rms", "0.05",
        "--period-s", "0.0005", "--delay-s", "0.0013", "--band", "5,100", "-o", "m.npz",
        "--effect", "coulomb_friction=force:0.002", "--effect", "extra_delay",
    )  # fmt: skip
    assert status == 0
    recording = bayeshaptic.read_recording("m.npz")
    assert recording.samples == 6000 and recording.period_s == pytest.approx(0.0005)
    assert np.std(recording.force) == pytest.approx(0.05, rel=0.01)
    spectrum = np.abs(np.fft.rfft(recording.force))
    excited = np.flatnonzero(spectrum > 1e-6 * spectrum.max()) / 3.0
    assert excited.min() == 5 and excited.max() == 100


@pytest.mark.parametrize(
    ("options", "part"),
    [
        (("--seconds", "1e9"), "1,000,000,000,000 samples"),
        (("--seconds", "1e9", "--excitation", "relay"), "1,000,000,000,000 samples"),
        (("--band", "600,900"), "ends above the Nyquist frequency, 500 Hz"),
        (("--band", "600,900", "--excitation", "prbs"), "ends above the Nyquist"),
        (("--band", "1,100", "--excitation", "relay"), "a relay has none"),
        (("--delay-s", "200"), "delay of 200 s is over 100 sampling periods"),
    ],
)
def test_what_the_bench_cannot_simulate_is_one_line(
    run: Run, options: tuple[str, ...], part: str
) -> None:
    status, out, err = run("simulate", "lhifam", "-o", "a.csv", *options)
    assert status == 2 and not out and not Path("a.csv").exists()
    assert part in only_line(err) and "defect" not in err


def test_simulate_from_a_posterior_and_from_its_priors(run: Run, tmp_path: Path) -> None:
    fake_analysis("grasped", device="lhifam").posterior.save(tmp_path / "p.nc")
    status, _, err = run("simulate", "p.nc", "-o", "a.csv", "--free")
    assert status == 2 and "a posterior.nc says who holds it" in only_line(err)
    truths = []
    for options in ((), ("--seed", "1"), ("--from-prior",)):
        status, out, err = run(
            "simulate", "p.nc", "-o", "a.csv", "--seconds", "1", "--force", *options
        )
        assert status == 0 and not err
        truths.append(float(out.split("stiffness ")[1].split()[0]))
    assert len(set(truths)) == 3 and min(truths[:2]) > 1e3 and max(truths[:2]) < 1e5
    status, _, err = run("simulate", "phantom", "-o", "b.csv", "--from-prior")
    assert status == 2 and "--from-prior is for a posterior.nc" in only_line(err)


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are Unicode there")
def test_names_that_are_no_utf_8(run: Run, phantom: Path, tmp_path: Path) -> None:
    folder = tmp_path / "recordings"
    folder.mkdir()
    path = folder / os.fsdecode(b"caf\xe9.csv")
    path.write_bytes(phantom.read_bytes())
    status, _, err = run("batch", folder, "-o", "out", "--workers", "1", "--quiet", *RIGID)
    assert status == 0, err
    made = tmp_path / "out" / path.stem
    summary = json.loads((made / "summary.json").read_text(encoding="utf-8"))
    assert summary["recording"]["file"] == str(path)
    assert r"caf\udce9" in (made / "report.html").read_text(encoding="utf-8")
    # Done and unchanged, by the manifest.
    assert run("status", "out")[0] == 0


WRITING = {
    "recording": "simulate('phantom', '-o', 'a.h5')",
    "posterior": "write({'posterior': Group({'x': Variable(('d',), np.ones(99999))}, {})}, path)",
}


@pytest.mark.skipif(os.name == "nt", reason="a limit of POSIX, which stands for a full disk")
@pytest.mark.parametrize("what", WRITING)
def test_a_full_disk_is_an_error_and_no_crash(tmp_path: Path, what: str) -> None:
    """The HDF5 library crashes the process where a file that it writes cannot grow."""
    script = f"""
import resource, sys
from pathlib import Path
import numpy as np
from bayeshaptic.cli import main
from bayeshaptic.inference.saved.netcdf import Group, Variable, write
resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, 10_000))
path = Path("a.nc")
simulate = lambda *words: sys.exit(main(["simulate", *words]))
try:
    {WRITING[what]}
except OSError as error:
    sys.exit(2)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, timeout=120
    )
    assert done.returncode == 2, done.stderr
    assert b"Traceback" not in done.stderr and not list(tmp_path.iterdir())


def test_effects_are_parsed() -> None:
    assert parse_effect("reflex") == ("reflex", {})
    assert parse_effect("a=x:1.5,y:-2e-3") == ("a", {"x": 1.5, "y": -2e-3})


def test_a_terminal_that_lacks_a_sign_shows_another(phantom: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "bayeshaptic", "inspect", str(phantom)],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert b"position" in done.stdout and b"?" in done.stdout


def test_a_mistyped_option_is_answered_by_its_command(run: Run, tmp_path: Path) -> None:
    for wrong, right in (("--colums", "--columns"), ("--wrkers=2", "--workers")):
        status, _, err = run("report", "a.csv", wrong)
        assert status == 2 and err.startswith("bayeshaptic report: error: unrecognized arguments")
        assert f"did you mean '{right}'?" in err and err.count("\n") == 1
    status, _, err = run("report", "a.csv", "b.csv")
    assert status == 2 and "unrecognized arguments: b.csv (see bayeshaptic report" in err
    there = tmp_path / "b.csv"
    there.touch()
    status, _, err = run("report", "a.csv", str(there))
    assert status == 2 and "are a study (.toml)" in err and "'bayeshaptic batch'" in err
