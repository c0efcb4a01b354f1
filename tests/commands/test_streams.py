"""The command line whose standard streams are closed, full, or read by nobody."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "phantom-free.csv.gz"


@pytest.mark.skipif(os.name == "nt", reason="a shell of POSIX closes streams")
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_change_nothing(tmp_path: Path, closed: str) -> None:
    """As schedulers and services start programs."""
    program = [sys.executable, "-m", "bayeshaptic", "inspect", RECORDING, "--write", "study.toml"]
    line = f"{shlex.join(map(str, program))} {closed}"
    done = subprocess.run(["sh", "-c", line], cwd=tmp_path, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "study.toml").read_text(encoding="utf-8").startswith("# A study")


@pytest.mark.skipif(os.name == "nt", reason="pipes of POSIX")
@pytest.mark.parametrize(
    ("words", "buffered"),
    [
        (["explain"], True),
        (["explain", "feedback"], True),
        (["explain"], False),
        (["--help"], True),
    ],
)
def test_who_has_seen_enough_is_told_nothing(words: list[str], buffered: int) -> None:
    """As in ``bayeshaptic explain | head -1``; containers set PYTHONUNBUFFERED."""
    reading, writing = os.pipe()
    os.close(reading)
    done = program(words, stdout=writing, unbuffered="" if buffered else "1")
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, b"")


FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not FULL.exists(), reason="a device of Linux")


@needs_full
@pytest.mark.parametrize("words", [["explain"], ["--help"], ["--version"]])
def test_an_output_that_is_full_is_one_line(words: list[str]) -> None:
    with FULL.open("w") as full:
        done = program(words, stdout=full)
    assert done.returncode == 2
    assert done.stderr.startswith(b"bayeshaptic: error: ") and done.stderr.count(b"\n") == 1
    assert b"standard output: No space left" in done.stderr


@needs_full
@pytest.mark.parametrize(("words", "status"), [(["explain", "zzz"], 2), (["zzz"], 2), ([], 2)])
def test_errors_that_cannot_be_told_leave_the_status(words: list[str], status: int) -> None:
    with FULL.open("w") as full:
        done = program(words, stderr=full)
    assert (done.returncode, done.stdout) == (status, b"")


@pytest.mark.skipif(os.name == "nt", reason="Windows keeps a folder that is used")
def test_a_working_directory_that_is_gone_is_named(tmp_path: Path) -> None:
    """As that of a shell whose folder somebody has removed: the error said no place."""
    # -P as the program has it: modules looked for in what is gone are an error of Python's own.
    line = f"mkdir gone && cd gone && rmdir ../gone && exec {shlex.quote(sys.executable)} -P -c"
    code = "from bayeshaptic.cli import main; raise SystemExit(main(['batch', 'x', '-o', 'y']))"
    done = subprocess.run(
        ["sh", "-c", f"{line} {shlex.quote(code)}"], cwd=tmp_path, capture_output=True, timeout=120
    )
    assert done.returncode == 2
    assert done.stderr.startswith(b"bayeshaptic: error: the working directory, change to another:")
    assert done.stderr.count(b"\n") == 1


def program(words: list[str], unbuffered: str = "", **streams: Any) -> Any:
    """The command line in a process of its own."""
    line = [sys.executable, "-m", "bayeshaptic", *words]
    piped = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams
    environment = os.environ | {"PYTHONUNBUFFERED": unbuffered}
    return subprocess.run(line, timeout=120, env=environment, **piped)
