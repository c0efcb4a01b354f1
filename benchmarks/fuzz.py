"""Damaged files at every door: no traceback, no crash, none over 10 s (of processor time) or 2 GiB.

    python -m benchmarks.fuzz                      2000 files a format
    python -m benchmarks.fuzz --count 200 csv npz  fewer, of some formats

Each case is a good file with bytes changed, moved, repeated or cut off, read in a process that this
one watches. What is not a one-line refusal (`InputError`) or a result is printed with the seed that
makes it again (`--only SEED`). Readers that run in a process of their own are forked here from one
that has their libraries loaded, under the same bounds; every twentieth is started as users have it.
Needs a system with `fork`.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import io
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections import Counter
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from bayeshaptic import cli
from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers import apart, reader_for
from benchmarks.recordings.damaged import STUDY, Door, doors, every_format, mutated

MOST_SECONDS = 10.0
MOST_KB = 2 << 20
AS_USERS_HAVE_IT = 20  # every so many files are read by a process that is started, not forked
LIBRARIES = ("h5py", "matio", "nptdms", "openpyxl", "scipy.io")

WORDS = """
report batch relay simulate population inspect a.csv study.toml none.csv . lhifam phantom -o out
--columns time=t,force=u,position=q force=u*0 position=q[furlong] time=,= --period-s 0 -1e-3 nan
1e400 --band 1,2 200,1 a,b --model rigid grasped --device --delay-s --delay-sd-s --seed -3
--workers 0 --quiet --held --effect coulomb_friction=force:x --excitation relay --rows 5:2
--seconds 0:1e9 \\x1b[31m --no-loop
"""


def forked(words: list[str], **how: Any) -> subprocess.CompletedProcess[bytes]:
    """In the place of `subprocess.run` in `read_apart`: the same work in a fork of this process."""
    *_, title, file, seconds = words
    reader = reader_for(Path(file))
    assert reader.title == title
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            with contextlib.suppress(BaseException):
                os.dup2(out.fileno(), 1)
                os.dup2(said.fileno(), 2)
                texts = open(1, "w"), open(2, "w")  # noqa: SIM115
                sys.stdout, sys.stderr = texts
                apart.write_arrays(reader, Path(file), int(seconds))
            os._exit(1)
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        out.seek(0), said.seek(0)
        return subprocess.CompletedProcess(words, status, out.read(), said.read())


def processor_time() -> float:
    """Seconds that this process and its children have taken: the clock says how busy others are."""
    times = os.times()
    return sum((times.user, times.system, times.children_user, times.children_system))


def attempt(name: str, door: Door, path: Path, content: bytes, seed: int) -> str:
    """ "read", "refused", or what went wrong."""
    rng = np.random.default_rng(seed)
    began = processor_time()
    said = io.StringIO()
    fork = seed % AS_USERS_HAVE_IT != 0
    try:
        with (
            contextlib.redirect_stderr(said),
            contextlib.redirect_stdout(said),
            mock.patch("subprocess.run", forked) if fork else contextlib.nullcontext(),
        ):
            warnings.simplefilter("ignore")
            if name == "command":
                result = command(rng)
            else:
                path.write_bytes(mutated(content, rng))
                door(path)
                result = "read"
    except InputError as error:
        result = "refused" if "\n" not in str(error) else "more than a line"
    except Exception as error:
        result = f"{type(error).__name__}: {str(error)[:100]!r}"
    if "defect" in said.getvalue() or "Traceback" in said.getvalue():
        result = f"said {said.getvalue()[:200]!r}"
    seconds = processor_time() - began
    return result if seconds < MOST_SECONDS else f"{result}, {seconds:.0f} s"


def command(rng: np.random.Generator) -> str:
    """A command line of random words; its exit status has to be one of ours."""
    words = [str(word) for word in rng.choice(WORDS.split(), rng.integers(1, 9))]
    try:
        status = cli.main(words)
    except SystemExit as stop:
        status = stop.code
    if status not in (0, 1, 2):
        return f"status {status} of {words}"
    return "refused" if status else "read"


def watched(name: str, case: tuple[bytes, str, Door], seeds: list[int], folder: Path) -> Counter:
    """Outcomes of all seeds; a process that dies is one outcome, and the next goes on."""
    content, file, door = case
    outcomes: Counter = Counter()
    context = multiprocessing.get_context("fork")
    while seeds:
        here, there = context.Pipe(duplex=False)

        def work(left: list[int] = seeds, there: Any = there) -> None:
            for seed in left:
                there.send(attempt(name, door, folder / file, content, seed))
            own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            below = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
            there.send(max(own, below))

        process = context.Process(target=work)
        process.start()
        there.close()
        done = 0
        try:
            while done < len(seeds):
                if not here.poll(10 * MOST_SECONDS):
                    break
                result = here.recv()
                if result not in ("read", "refused"):
                    print(f"  {name} --only {seeds[done]}: {result}", flush=True)
                    result = "WRONG"
                outcomes[result] += 1
                done += 1
            else:
                kb = here.recv()
                if kb > MOST_KB:
                    print(f"  {name}: {kb / 2**20:.1f} GiB")
                    outcomes["WRONG"] += 1
        except EOFError:
            pass
        if done < len(seeds):
            process.kill()
            process.join()
            print(f"  {name} --only {seeds[done]}: died or hung ({process.exitcode})", flush=True)
            outcomes["WRONG"] += 1
            done += 1
        process.join()
        seeds = seeds[done:]
    return outcomes


def main() -> int:
    """The table; 1 where anything went wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("formats", nargs="*", help="all by default")
    parser.add_argument("--count", type=int, default=2000, help="files a format")
    parser.add_argument("--only", type=int, help="one seed")
    arguments = parser.parse_args()
    wrong = 0
    with tempfile.TemporaryDirectory() as place, contextlib.chdir(place):
        folder = Path(place)
        cases = doors(folder)
        if unknown := set(arguments.formats) - set(cases):
            parser.error(f"no format {', '.join(unknown)}; there are {', '.join(cases)}")
        for library in LIBRARIES:
            importlib.import_module(library)
        every_format.write_csv(folder / "a.csv")
        (folder / "study.toml").write_text(STUDY)
        for name in arguments.formats or cases:
            began = time.perf_counter()
            seeds = [arguments.only] if arguments.only is not None else list(range(arguments.count))
            outcomes = watched(name, cases[name], seeds, folder)
            wrong += outcomes["WRONG"]
            print(
                f"{name:14s} read {outcomes['read']:5d}  refused {outcomes['refused']:5d}  "
                f"wrong {outcomes['WRONG']:3d}  {time.perf_counter() - began:6.1f} s",
                flush=True,
            )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
