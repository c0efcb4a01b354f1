"""Good files of each format, what reads them, and how they are damaged."""

from __future__ import annotations

import hashlib
import importlib
import io
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from bayeshaptic import load_posterior
from bayeshaptic.devices import load_device
from bayeshaptic.errors import InputError
from bayeshaptic.inference.sampling.run import Run
from bayeshaptic.inference.saved import checkpoint
from bayeshaptic.recordings import read_frf, read_recording, read_study

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "support"))
every_format = importlib.import_module("every_format")

DIGEST = hashlib.sha256().digest_size
Door = Callable[[Path], Any]

STUDY = """
[device]
name = "mine"
kind = "rotational"
period_s = 1e-3
delay_s = 2e-4
columns = "time=t,force=u,position=q"
[prior]
m1 = { median = 0.2, log_sd = 0.3 }
b2 = { scale = 5, floor = 5e-6 }
[[recording]]
file = "a.csv"
user = "Ada"
configuration = 0.3
[[reference]]
label = "relay"
held = true
critical_stiffness_db = [40.6, 40.9]
"""
DEVICE = """
name = "mine"
kind = "translational"
delay_s = 2e-4
delay_sd_s = 2e-5
band_hz = [0.3, 300]
notes = ["x"]
[free]
m1 = 0.19
b1 = 0.1
kc = 5e4
"""


def doors(folder: Path) -> dict[str, tuple[bytes, str, Door]]:
    """A good file, its name, and what reads it, of each format."""
    found: dict[str, tuple[bytes, str, Door]] = {}
    for name, write in every_format.WRITERS.items():
        write(folder / name)
        mapping = every_format.mapping_of(name)
        key = {"a.csv": "csv", "a.mat": "mat5", "b.mat": "mat73", "a.h5": "hdf5", "a.npz": "npz"}
        content = (folder / name).read_bytes()
        found[key.get(name, name)] = (
            content,
            name,
            lambda path, m=mapping: read_recording(path, m),
        )
    rows = "\n".join(f"{f},{-f},{-180},1e-6" for f in range(1, 20))
    table = f"frequency_hz,gain_db,phase_deg,sd\n{rows}\n"
    found["frf"] = (table.encode(), "frf.csv", lambda path: read_frf(path, 1e-3))
    found["study"] = (STUDY.encode(), "study.toml", read_study)
    found["device"] = (DEVICE.encode(), "device.toml", load_device)
    saved, state, name = posterior(folder)
    found["posterior"] = (saved, "posterior.nc", load_posterior)
    key = str(np.load(io.BytesIO(state[DIGEST:]))["key"])
    found["checkpoint"] = (state, name, lambda path: restored(path, key))
    # Damage that the hash does not show: somebody who can write may hash, too.
    found["checkpoint in"] = (state[DIGEST:], name, lambda path: restored(hashed(path), key))
    found["command"] = (b"", "command", lambda _: None)
    return found


def posterior(folder: Path) -> tuple[bytes, bytes, str]:
    """A saved posterior, of few draws, and the state of its sampler with the file's name."""
    import bayeshaptic as bh  # loads numba, which looks for that library

    recording = ROOT / "data" / "recordings" / "phantom-free.csv.gz"
    etfe = bh.estimate_etfe(bh.read_recording(recording), band_hz=(1, 25))
    model = bh.rigid(device="phantom")
    fit = bh.least_squares(model, etfe)
    with mock.patch.object(checkpoint, "EVERY_S", 0.0):
        found = bh.sample(model, etfe, start=fit, ess=50, checkpoints=folder / "kept")
    found.save(folder / "p.nc")
    (state,) = (folder / "kept").iterdir()
    return (folder / "p.nc").read_bytes(), state.read_bytes(), state.name


def restored(path: Path, key: str) -> Run:
    """The run that a checkpoint holds; refused where the sampler would start anew."""
    kept = checkpoint.Checkpoint(path.parent, key)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        run = kept.read(lambda arrays: Run.from_arrays(arrays, np.ravel, None))
    if run is None:
        raise InputError(str(told[-1].message))
    return run


def hashed(path: Path) -> Path:
    """The file with the hash of what is in it before that."""
    content = path.read_bytes()
    path.write_bytes(hashlib.sha256(content).digest() + content)
    return path


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """`content` with up to a dozen changes."""
    changed = bytearray(content)
    for _ in range(min(rng.geometric(0.4), 12)):
        if not changed:
            break
        place, size = int(rng.integers(len(changed))), int(rng.geometric(0.05))
        kind = rng.integers(6)
        if kind == 0:
            changed[place] = int(rng.integers(256))
        elif kind == 1:
            changed[place] ^= 1 << int(rng.integers(8))
        elif kind == 2:
            del changed[place : place + size]
        elif kind == 3:
            changed[place:place] = changed[place : place + size]
        elif kind == 4:
            changed[place : place + 8] = rng.choice([0, 0x7F, 0xFF]).astype(np.uint8).tobytes() * 8
        elif rng.uniform() < 0.2:
            del changed[place:]
    return bytes(changed)
