"""Results appear whole or not at all, and what died is tidied up."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import pytest

from bayeshaptic import cli
from bayeshaptic.errors import InputError
from bayeshaptic.files import remove_dead_drafts, write_whole
from bayeshaptic.jobs.batch import run_batch
from bayeshaptic.jobs.job import Job, Settings
from bayeshaptic.jobs.study import report_population, report_study
from bayeshaptic.report.draft import draft_in, for_one_run, move_all, report_in


def test_a_draft_is_moved_or_leaves_nothing(tmp_path: Path) -> None:
    out = tmp_path / "out"
    for text in ("old", "new"):
        with draft_in(tmp_path) as draft:
            for name in ("a", "z", "last"):
                (draft / name).write_text(text)
            move_all(draft, out, "last")
        assert {path.name: path.read_text() for path in out.iterdir()} == dict.fromkeys(
            ("a", "z", "last"), text
        )
    with pytest.raises(OSError, match="full"), draft_in(out) as draft:
        (draft / "a").write_text("never")
        raise OSError("full")
    assert (out / "a").read_text() == "new"
    write_whole(out / "b", "x")
    assert sorted(os.listdir(out)) == ["a", "b", "last", "z"]


@pytest.mark.skipif(sys.platform == "win32", reason="no lock of a folder")
@pytest.mark.parametrize("new", [False, True])
def test_two_reports_in_one_folder_are_one_of_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, new: bool
) -> None:
    out, replace, ready = tmp_path / "out", os.replace, threading.Barrier(2)
    files = {"1": "abd", "2": "bcd"}
    if not new:
        out.mkdir()

    def slowly(*names: Path) -> None:
        time.sleep(0.01)
        replace(*names)

    def report(who: str) -> None:
        with report_in(out, "last", ["a", "b", "c"]) as draft:
            for name in (*files[who], "last"):
                (draft / name).write_text(who)
            ready.wait(timeout=10)

    monkeypatch.setattr(os, "replace", slowly)
    with ThreadPoolExecutor(2) as both:
        list(both.map(report, "12"))
    found = {path.name: path.read_text() for path in out.iterdir()}
    assert found in [dict.fromkeys((*own, "last"), who) for who, own in files.items()]


CLAIM = """
import os, sys
from pathlib import Path
from bayeshaptic.report.draft import for_one_run
with for_one_run(Path(sys.argv[1])):
    print("in", flush=True)
    sys.stdin.read()
    os.kill(os.getpid(), 9)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no lock of a file")
def test_two_studies_are_not_written_into_one_folder(tmp_path: Path) -> None:
    """Nor two batches; who died is in nobody's way."""
    out, study, batch = tmp_path / "new" / "out", tmp_path / "study.toml", tmp_path / "a.csv"
    (tmp_path / "free.csv").write_text("no recording")
    batch.write_text("no recording")
    study.write_text('[device]\nname = "lhifam"\n[[recording]]\nfile = "free.csv"\n')
    command = [sys.executable, "-c", CLAIM, str(out)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None and other.stdout.readline()
        job = Job(study, out, Settings())
        for run in (
            partial(report_study, job, None, 1),
            partial(report_population, job, None, 1),
            partial(run_batch, [batch], out),
        ):
            with pytest.raises(InputError, match="out: another run of bayeshaptic is writing"):
                run()
        assert os.listdir(out) == [".in-use"]
        other.communicate(b"")
    assert os.listdir(out) == [".in-use"]  # it could not tidy up
    with for_one_run(out), pytest.raises(InputError, match="another run"), for_one_run(out):
        pass
    assert os.listdir(out) == []
    shutil.rmtree(tmp_path / "new")
    assert [one.page for one in report_study(job, None, 1)] == [None]  # nothing could be used
    assert not (tmp_path / "new").exists()


def test_what_is_in_the_way_of_a_study_is_told_before_any_work(tmp_path: Path) -> None:
    study, out = tmp_path / "study.toml", tmp_path / "out"
    (tmp_path / "free.csv").write_text("no recording")
    study.write_text('[device]\nname = "lhifam"\n[[recording]]\nfile = "free.csv"\n')
    out.mkdir()
    (out / "free").write_text("a file where a folder is to be")
    with pytest.raises(InputError, match="free is a file; name a folder"):
        report_study(Job(study, out, Settings()), None, 1)
    (out / "free").unlink()
    (out / "free").mkdir()
    (out / "free" / "limits.csv").write_text("time_s,force_n,position_m\n")
    with pytest.raises(InputError, match=r"limits\.csv: .* of no report; move it"):
        report_study(Job(study, out, Settings()), None, 1)
    assert sorted(os.listdir(out)) == ["free"]


@pytest.mark.skipif(sys.platform == "win32", reason="links")
def test_links_in_a_circle_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.csv").symlink_to("b.csv")
    (tmp_path / "b.csv").symlink_to("a.csv")
    (tmp_path / "study.toml").write_text(
        '[device]\nname = "x"\nkind = "rotational"\n[[recording]]\nfile = "a.csv"\n'
    )
    monkeypatch.chdir(tmp_path)
    lines = (
        "report a.csv -o out",
        "report a.csv/in.csv -o out",
        "report study.toml -o out",
        "report study.toml -o a.csv",
        "inspect b.csv",
        "batch a.csv -o out",
    )
    for line in lines:
        assert cli.main(line.split()) != 0
        told = capsys.readouterr()
        assert "a link that leads in a circle" in told.err + told.out, line
        assert "defect" not in told.err, line
    assert not (tmp_path / "out").exists() or not list((tmp_path / "out").glob("**/report.html"))


def test_an_error_names_the_file_and_not_its_draft(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as caught:
        write_whole(tmp_path / "no" / "b.json", "x")
    assert caught.value.filename == str(tmp_path / "no" / "b.json")
    with (
        pytest.raises(FileNotFoundError) as caught,
        report_in(tmp_path / "out", "b", []) as draft,
    ):
        draft.rmdir()
        (draft / "a").write_text("x")
    assert caught.value.filename == str(tmp_path.resolve() / "out" / "a")


@pytest.mark.parametrize("name", ["limits.csv", "summary.json", "posterior.nc"])
def test_a_report_does_not_replace_what_it_is_made_from(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("time_s,force_n,position_m\n")

    def report() -> None:
        with report_in(tmp_path, "summary.json", ["posterior.nc"], [tmp_path / name]) as draft:
            for each in {"summary.json", name}:
                (draft / each).write_text("new")

    with pytest.raises(InputError, match=f"{name}: the report has a file of this name"):
        report()
    assert os.listdir(tmp_path) == [name]
    assert (tmp_path / name).read_text() == "time_s,force_n,position_m\n"


def test_a_report_replaces_a_report_and_nothing_else(tmp_path: Path) -> None:
    def report() -> None:
        with report_in(tmp_path, "summary.json", []) as draft:
            (draft / "limits.csv").write_text("damping_filter,cutoff_hz,smoothing,b\n")
            (draft / "summary.json").write_text('{"critical_stiffness": null}')

    report()
    report()
    (tmp_path / "limits.csv").write_text("time_s,force_n,position_m\n")
    with pytest.raises(InputError, match=r"limits\.csv: .*, and this one is of no report; move it"):
        report()
    assert (tmp_path / "limits.csv").read_text() == "time_s,force_n,position_m\n"
    assert sorted(os.listdir(tmp_path)) == ["limits.csv", "summary.json"]
    with pytest.raises(InputError, match="empty name"), report_in("", "summary.json", []):
        pass


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be asked whether it lives")
def test_drafts_of_the_dead_are_removed(tmp_path: Path) -> None:
    code = "import os, sys; from pathlib import Path; from bayeshaptic.report.draft import draft_in"
    kill = f"{code}\nwith draft_in(Path(sys.argv[1])): os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", kill, str(tmp_path)], check=False)
    assert len(os.listdir(tmp_path)) == 1
    with draft_in(tmp_path) as mine, draft_in(tmp_path) as other:
        assert {mine.name, other.name} == set(os.listdir(tmp_path))
    assert not os.listdir(tmp_path)


WORKING = """
import sys, time
from bayeshaptic import cli
from bayeshaptic.jobs import executors
from bayeshaptic.commands import batch

def run(_):
    print(list(executors.processes(2)(time.sleep, [60, 60])))

batch.run = run
if __name__ == "__main__":
    sys.exit(cli.main(["batch", "a.csv"]))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGKILL])
def test_workers_end_with_their_parent(tmp_path: Path, sign: int) -> None:
    script = tmp_path / "work.py"
    script.write_text(WORKING)
    with subprocess.Popen([sys.executable, str(script)], stderr=subprocess.PIPE) as process:
        children = _wait_for(lambda: _children(process.pid, 2))
        began = time.monotonic()
        process.send_signal(sign)
        process.wait(timeout=30)
        assert _wait_for(lambda: not any(map(_working, children)))
        assert time.monotonic() - began < 20  # 5 s on an idle machine
    assert process.returncode == (143 if sign == signal.SIGTERM else -9)


def _children(parent: int, least: int) -> list[int]:
    """Workers that `parent` has started."""
    found = []
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = status.read_text().rpartition(")")[2].split()
            command = status.with_name("cmdline").read_bytes()
        except OSError:
            continue
        if int(text[1]) == parent and b"spawn_main" in command:
            found.append(int(status.parent.name))
    return found if len(found) >= least else []


def _working(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _wait_for(found: object) -> object:
    for _ in range(300):
        if result := found():
            return result
        time.sleep(0.1)
    raise AssertionError("never happened")


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be asked whether it lives")
def test_half_written_files_of_the_dead_are_removed(tmp_path: Path) -> None:
    code = f"""
import os, sys
from pathlib import Path
from bayeshaptic import files
os.replace = lambda *_: os.kill(os.getpid(), 9)
files.write_whole(Path({str(tmp_path / "index.html")!r}), "half")
"""
    subprocess.run([sys.executable, "-c", code], check=False)
    (left,) = os.listdir(tmp_path)
    assert left.startswith(".part-")
    remove_dead_drafts(tmp_path)
    assert not os.listdir(tmp_path)


LOST = """
import ctypes, sys, time
from bayeshaptic import cli
from bayeshaptic.commands import explain
def called():
    print("here", flush=True)
    time.sleep({seconds})
def run(arguments):
    ctypes.CFUNCTYPE(None)(called)()  # what is raised in there is lost
    if {fails}:
        raise RuntimeError("no compiled object yet")
    time.sleep(60)
explain.run = run
sys.exit(cli.main())
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("fails", [False, True])
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_that_was_lost_is_raised_again(sign: int, fails: bool) -> None:
    words = [sys.executable, "-c", LOST.format(seconds=30, fails=fails), "explain", "units"]
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None and process.stdout.readline() == "here\n"
        began = time.monotonic()
        process.send_signal(sign)
        _, told = process.communicate(timeout=30)
        assert time.monotonic() - began < 3.0
    word = "terminated" if sign == signal.SIGTERM else "interrupted"
    assert process.returncode == 128 + sign and told.count("\n") == 1 and word in told


STUCK = """
import time
from bayeshaptic import cli
from bayeshaptic.commands import explain
def run(arguments):
    try:
        print("here", flush=True)
        time.sleep(60)
    finally:
        time.sleep(60)
cli.LAST_S, explain.run = 0.1, run
cli.main()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("sign", [signal.SIGTERM, signal.SIGINT])
def test_what_does_not_end_by_itself_is_ended(sign: int) -> None:
    words = [sys.executable, "-c", STUCK, "explain", "units"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline() == "here\n"
    process.send_signal(sign)
    assert process.wait(timeout=30) == 128 + sign
    process.stdout.close()


def test_what_another_container_writes_is_left_alone(tmp_path: Path) -> None:
    """It may have this machine's name, and its process a number that nobody has here."""
    apart = ["unshare", "--pid", "--fork", "--mount-proc"]
    if not shutil.which("unshare") or subprocess.run([*apart, "true"]).returncode:
        pytest.skip("no container can be made")
    code = f"""
import os
from pathlib import Path
from bayeshaptic.files import remove_dead_drafts
from bayeshaptic.report.draft import draft_in
with draft_in(Path({str(tmp_path)!r})) as draft:
    print(draft, flush=True)
    input()
"""
    # Not 1, which lives everywhere.
    line = [*apart, "sh", "-c", 'for _ in $(seq 300); do true & wait; done; "$0" -c "$1"; true']
    with subprocess.Popen(
        [*line, sys.executable, code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as there:
        assert there.stdout is not None
        draft = Path(there.stdout.readline().strip())
        remove_dead_drafts(tmp_path)
        assert draft.is_dir()
        there.communicate("\n", timeout=60)
    assert not draft.exists()
