"""A sampler that was killed goes on, with the numbers of one that was not."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import bayeshaptic as bh
from bayeshaptic.files import whole_file
from bayeshaptic.inference.saved import checkpoint
from bayeshaptic.inference.saved.checkpoint import Checkpoint, kept_until_done
from bayeshaptic.jobs import recording as jobs_recording
from bayeshaptic.jobs.job import Job, Settings

RECORDING = Path(__file__).parents[2] / "data" / "recordings" / "phantom-free.csv.gz"

SAMPLE = """
import hashlib, os, sys
import bayeshaptic as bh
from bayeshaptic.inference.saved import checkpoint

recording, folder, most = sys.argv[1], sys.argv[2] or None, int(sys.argv[3])
checkpoint.EVERY_S = 0.0
write, written = checkpoint.Checkpoint.write, []

def write_and_die(self, arrays):
    write(self, arrays)
    written.append(self)
    if len(written) == most:
        os.kill(os.getpid(), 9)

checkpoint.Checkpoint.write = write_and_die
etfe = bh.estimate_etfe(bh.read_recording(recording), band_hz=(1, 25))
posterior = bh.sample(bh.rigid(device="phantom"), etfe, ess=150000, checkpoints=folder)
print(hashlib.sha256(posterior.chains.tobytes() + posterior.log_likelihood.tobytes()).hexdigest())
print(posterior.chains.shape[1], posterior.message, len(written))
"""


def sampled(folder: Path | str, most: int = 0) -> subprocess.CompletedProcess[str]:
    words = [sys.executable, "-W", "error", "-c", SAMPLE, str(RECORDING), str(folder), str(most)]
    return subprocess.run(words, capture_output=True, text=True, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="kill -9")
def test_a_killed_sampler_goes_on_with_the_same_numbers(tmp_path: Path) -> None:
    quiet = sampled("").stdout.splitlines()
    for most in (1, 2):
        assert sampled(tmp_path / "kept", most).returncode == -9
    resumed = sampled(tmp_path / "kept").stdout.splitlines()
    assert resumed[0] == quiet[0]  # every draw, to the last digit
    assert resumed[1].rsplit(" ", 1)[0] == quiet[1].rsplit(" ", 1)[0]
    assert int(resumed[1].split()[-1]) > 0  # it had not been done


def posterior_with(folder: Path | None) -> bh.Posterior:
    etfe = bh.estimate_etfe(bh.read_recording(RECORDING), band_hz=(1, 25))
    return bh.sample(bh.rigid(device="phantom"), etfe, ess=500, checkpoints=folder)


def test_what_cannot_be_used_is_one_line_and_a_new_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(checkpoint, "EVERY_S", 0.0)
    good = posterior_with(tmp_path)
    (path,) = tmp_path.iterdir()
    content = path.read_bytes()
    foreign = tmp_path / "other"
    Checkpoint(foreign, "k" * 64).write({"chains": np.ones(3)})
    (other,) = foreign.iterdir()
    lacking = Checkpoint(tmp_path / "lacking", path_key(content))
    lacking.write({"chains": np.ones(3)})
    cases = {
        "damaged": content[:-1],
        "damaged ": b"",
        "another computation": other.read_bytes(),
        "numbers": lacking.path.read_bytes(),
    }
    for word, damaged in cases.items():
        path.write_bytes(damaged)
        with pytest.warns(bh.BayeshapticWarning, match=word.strip()) as told:
            again = posterior_with(tmp_path)
        assert len(told) == 1 and "\n" not in str(told[0].message)
        np.testing.assert_array_equal(again.chains, good.chains)
        assert path.read_bytes() == content  # written anew


def path_key(content: bytes) -> str:
    """The key that a checkpoint holds."""
    import io

    with np.load(io.BytesIO(content[hashlib.sha256().digest_size :])) as file:
        return str(file["key"])


def test_a_full_disk_does_not_stop_the_sampler(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(checkpoint, "EVERY_S", 0.0)
    monkeypatch.setattr(checkpoint, "whole_file", full)
    with pytest.warns(bh.BayeshapticWarning, match="No space left on device") as told:
        assert posterior_with(tmp_path).converged
    assert len(told) == 1


def test_nothing_is_kept_of_what_is_done_or_would_fail_again(tmp_path: Path) -> None:
    for error, kept in ((None, False), (ValueError, False), (KeyboardInterrupt, True)):
        folder = tmp_path / "c"
        folder.mkdir(exist_ok=True)
        try:
            with kept_until_done(folder):
                if error is not None:
                    raise error
        except (ValueError, KeyboardInterrupt):
            pass
        assert folder.exists() == kept


def test_an_interrupted_report_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkpoint, "EVERY_S", 0.0)
    found = []
    monkeypatch.setattr(jobs_recording, "reported", lambda name, result, *_: found.append(result))
    settings = Settings(model="rigid", device="phantom", band_hz=(1, 25), close_loop=False)
    job = Job(RECORDING, tmp_path / "out", settings)
    kept = tmp_path / "out" / ".checkpoints"
    jobs_recording.report_recording(job, None)
    with monkeypatch.context() as patch, pytest.raises(KeyboardInterrupt):
        patch.setattr("bayeshaptic.inference.sampler.run_until_done", interrupted)
        jobs_recording.report_recording(job, None)
    assert [path.suffix for path in kept.iterdir()] == [".state"]
    with monkeypatch.context() as patch:
        patch.setattr(
            "bayeshaptic.inference.sampler.warmed_up_about_peaks", None
        )  # it is not needed
        jobs_recording.report_recording(job, None)
    assert not kept.exists()
    quiet, resumed = (one.analysis.limit.samples for one in found)
    np.testing.assert_array_equal(resumed, quiet)


def interrupted(run, rule, left, report, keep) -> None:
    run.advance()
    keep(run)
    raise KeyboardInterrupt


def test_a_file_of_a_long_name_is_written(tmp_path: Path) -> None:
    path = tmp_path / ("n" * 240 + ".npz")
    with whole_file(path) as partial:
        np.savez(partial, a=np.ones(2))
    assert [one.name for one in tmp_path.iterdir()] == [path.name]
