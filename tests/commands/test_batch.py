"""Many recordings: found in folders, indexed, resumed; a failure stops nobody."""

from __future__ import annotations

import csv
import json
import os
import pickle
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import bayeshaptic as bh
from bayeshaptic import cli
from bayeshaptic.commands.talk import Talk
from bayeshaptic.errors import InputError
from bayeshaptic.jobs import batch, executors
from bayeshaptic.jobs.job import Job
from bayeshaptic.jobs.manifest import read_manifest
from bayeshaptic.jobs.sources import find_sources
from bayeshaptic.report.headline import Headline
from bayeshaptic.report.reported import Reported

LIMIT = {"unit": "N/m", "q05": 900.0, "q50": 1000.0, "q95": 1100.0, "safe": {"0.01": 850.0}}
SUMMARY = {
    "recording": {"device": "d", "user": "<Ada>", "configuration": None},
    "critical_stiffness": LIMIT | {"frequency_hz": {"q50": 50.0}},
    "recommendation": {"status": "safe", "stiffness": 850.0, "risk": 0.01},
    "diagnosis": {"verdict": "consistent"},
}


class Reports:
    """Stands for the analysis: counts what it is asked, and fails where the file says so."""

    def __init__(self) -> None:
        self.asked: list[str] = []
        self.disk_is_full = True

    def __call__(self, job: Job) -> tuple[Reported, ...]:
        self.asked.append(job.source.name)
        content = job.source.read_text()
        if content == "bad":
            raise InputError(f"{job.source}: refused")
        if content == "full" and self.disk_is_full:
            self.disk_is_full = False
            raise OSError(28, "No space left on device")
        job.folder.mkdir(parents=True, exist_ok=True)
        (job.folder / "summary.json").write_text(json.dumps(SUMMARY))
        headline = Headline("safe", "Render it.", ())
        return (Reported(job.source.name, job.folder / "report.html", headline),)


@pytest.fixture
def reports(monkeypatch: pytest.MonkeyPatch) -> Reports:
    found = Reports()
    monkeypatch.setattr(batch, "report_source", found)
    return found


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    place = tmp_path / "recordings"
    (place / "more").mkdir(parents=True)
    for name, text in {"a.csv": "1", "b.csv": "bad", "more/c.csv": "full"}.items():
        (place / name).write_text(text)
    return place


def test_what_is_in_a_folder(folder: Path) -> None:
    (folder / "s.toml").write_text("[[recording]]\nfile='more/c.csv'\n")
    (folder / "device.toml").write_text("kind='rotational'\n")
    (folder / ".hidden.csv").write_text("1")
    (folder / "old").mkdir()
    for name in ("summary.json", "limits.csv"):
        (folder / "old" / name).write_text("damping_filter,cutoff_hz,smoothing,1")
    assert [path.name for path in find_sources([folder])] == ["s.toml", "a.csv", "b.csv"]
    with pytest.raises(InputError, match="no studies and no recordings"):
        find_sources([folder / "old"])
    # Of a folder that is named the recordings count, whatever else is in it.
    (folder / "old" / "x.npz").write_text("1")
    assert [path.name for path in find_sources([folder / "old"])] == ["x.npz"]


def test_a_batch_goes_on_and_is_resumed(folder: Path, tmp_path: Path, reports: Reports) -> None:
    out = tmp_path / "out"

    def run() -> list[str]:
        reports.asked.clear()
        entries = bh.run_batch([folder], out, executor=executors.serial)
        assert [entry.state for entry in entries] == ["done", "failed", "done"]
        return reports.asked

    # What a full disk stopped is tried again, at the end; what was refused is not.
    assert run() == ["a.csv", "b.csv", "c.csv", "c.csv"]
    assert run() == ["b.csv"]
    (folder / "a.csv").write_text("2")
    assert run() == ["a.csv", "b.csv"]
    (out / "c" / "summary.json").unlink()
    assert run() == ["b.csv", "c.csv"]
    (out / "manifest.json").write_text("{")
    assert run() == ["a.csv", "b.csv", "c.csv"]

    rows = list(csv.DictReader((out / "index.csv").read_text().splitlines()))
    assert [row["status"] for row in rows] == ["safe", "failed", "safe"]
    assert float(rows[0]["safe"]) == 850
    (failed,) = csv.DictReader((out / "failed.csv").read_text().splitlines())
    assert failed["error"].endswith("b.csv: refused")
    page = (out / "index.html").read_text()
    assert 'href="a/report.html"' in page and "&lt;Ada&gt;" in page and "://" not in page
    assert json.loads((out / "manifest.json").read_text())["versions"]["bayeshaptic"]


def test_a_batch_in_the_folder_of_its_recordings_is_resumed(folder: Path, reports: Reports) -> None:
    for asked in (["a.csv", "b.csv", "c.csv", "c.csv"], ["b.csv"]):
        reports.asked.clear()
        bh.run_batch([folder], folder, executor=executors.serial)
        assert reports.asked == asked


def test_recordings_of_one_name_are_reported_where_they_stand(
    tmp_path: Path, reports: Reports
) -> None:
    place = tmp_path / "recordings"
    for day in ("day1", "day2"):
        (place / day).mkdir(parents=True)
        (place / day / "plain.csv").write_text(day)
    (place / "day1" / "other.csv").write_text("1")
    bh.run_batch([place], tmp_path / "out", executor=executors.serial)
    rows = list(csv.DictReader((tmp_path / "out" / "index.csv").read_text().splitlines()))
    assert [row["name"] for row in rows] == ["other.csv", "day1/plain.csv", "day2/plain.csv"]
    for name in ("other", "day1/plain", "day2/plain"):
        assert (tmp_path / "out" / name / "summary.json").exists()
    assert len(bh.run_batch([place], tmp_path / "out", executor=executors.serial)) == 3
    assert len(reports.asked) == 3
    (place / "day1" / "plain.txt").write_text("1")
    with pytest.raises(InputError, match="both be reported in .*plain; rename one"):
        bh.run_batch([place], tmp_path / "out", executor=executors.serial)


def test_recordings_of_studies_are_named_with_their_study(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each study has its `free` and its `anna`, and the index had them all under one name."""

    def study(job: Job) -> tuple[Reported, ...]:
        free = Reported("free", job.folder / "free" / "report.html")
        device = Reported(job.folder.name, job.folder / "report.html")
        return free, Reported("anna", error="anna.csv: refused"), device

    for name in ("one", "two"):
        (tmp_path / f"{name}.toml").write_text("[[recording]]\nfile='free.csv'\n")
    monkeypatch.setattr(batch, "report_source", study)
    bh.run_batch([tmp_path], tmp_path / "out", executor=executors.serial)
    rows = list(csv.DictReader((tmp_path / "out" / "index.csv").read_text().splitlines()))
    names = ["one/free", "one/anna", "one", "two/free", "two/anna", "two"]
    assert [row["name"] for row in rows] == names


def test_recordings_named_as_files_of_a_report_are_recordings(
    tmp_path: Path, reports: Reports
) -> None:
    for name in ("limits.csv", "index.csv"):
        (tmp_path / name).write_text("time_s,force_n,position_m\n")
    assert [path.name for path in find_sources([tmp_path])] == ["index.csv", "limits.csv"]
    with pytest.raises(InputError, match=r"index\.csv: the report has a file of this name"):
        bh.run_batch([tmp_path], tmp_path, executor=executors.serial)
    assert (tmp_path / "index.csv").read_text() == "time_s,force_n,position_m\n"
    (tmp_path / "index.csv").unlink()
    bh.run_batch([tmp_path], tmp_path, executor=executors.serial)
    assert reports.asked == ["limits.csv"]


def test_a_thousand_recordings(tmp_path: Path, reports: Reports) -> None:
    """The index stays a page that opens at once, and what the parent keeps is a line each."""
    place = tmp_path / "many"
    place.mkdir()
    for number in range(1000):
        (place / f"r{number:03d}.csv").write_text(str(number))
    began = time.process_time()
    entries = bh.run_batch([place], tmp_path / "out", executor=executors.serial)
    assert time.process_time() - began < 20.0
    assert len(entries) == 1000 and all(entry.state == "done" for entry in entries)
    page = (tmp_path / "out" / "index.html").read_text()
    assert page.count("<tr>") == 1001 and len(page) < 2_000_000
    assert sum(len(pickle.dumps(entry)) for entry in entries) < 3_000_000
    assert bh.run_batch([place], tmp_path / "out", executor=executors.serial) == entries


def test_any_executor(folder: Path, tmp_path: Path, reports: Reports) -> None:
    with ThreadPoolExecutor(2) as pool:
        entries = bh.run_batch([folder], tmp_path / "out", executor=pool)
    assert [entry.state for entry in entries] == ["done", "failed", "done"]


def test_the_commands(
    folder: Path,
    tmp_path: Path,
    reports: Reports,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    out = tmp_path / "out"
    command = ["batch", str(folder), "-o", str(out), "--workers", "1", "--log", "json"]
    assert cli.main(command) == 1
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [line["state"] for line in lines] == ["done", "failed", "done"]
    assert cli.main(["status", str(out)]) == 1
    assert "2 of 3 done, 1 failed, 0 left" in capsys.readouterr().out
    # What was done before is no part of the forecast.
    shares: list[float] = []
    monkeypatch.setattr(Talk, "progress", lambda self, share, word: shares.append(share))
    assert cli.main(command[:-2]) == 1
    assert shares == [0.0, 0.0, 1.0]
    capsys.readouterr()
    killed = json.loads((out / "manifest.json").read_text(encoding="utf-8"))
    killed["entries"][0]["state"] = "waiting"
    for pid, ended in ((os.getpid(), False), (2**22 + 1, True), ("?", False)):
        text = json.dumps(killed | {"pid": pid})
        (out / "manifest.json").write_text(text, encoding="utf-8")
        assert cli.main(["status", str(out)]) == 1
        assert ("has ended" in capsys.readouterr().out) == ended
    assert cli.main(["status", str(tmp_path)]) == 2


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize(("stream", "status"), [("stdout", 2), ("stderr", 1)])
@pytest.mark.parametrize("log", ["text", "json"])
def test_a_log_that_is_full_stops_no_batch(
    reports: Reports,
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    stream: str,
    status: int,
    log: str,
) -> None:
    """The reports may be on another disk than what is said of them."""
    out = tmp_path / "out"
    with open("/dev/full", "w", buffering=1) as full, monkeypatch.context() as during:
        during.setattr(sys, stream, full)
        assert cli.main(["batch", str(folder), "-o", str(out), "--workers", "1", "--log", log]) == (
            status
        )
    states = [one.state for one in read_manifest(out).values()]
    assert states == ["done", "failed", "done"]
