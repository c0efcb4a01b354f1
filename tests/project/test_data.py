"""The recordings of data/ are those that its script makes, with the truth that its page states."""

from __future__ import annotations

import importlib.util
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from bayeshaptic.devices import load_device

DATA = Path(__file__).parents[2] / "data"


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_recordings", DATA / "make_recordings.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


MADE = script()


@pytest.mark.parametrize("entry", MADE.ENTRIES, ids=lambda entry: entry.name)
def test_recordings_are_made_again(entry: MADE.Entry) -> None:
    recording = entry.make(entry.bench)
    columns = np.loadtxt(entry.path, delimiter=",", skiprows=1, unpack=True)
    for name, stored, grid in zip(
        recording.columns, columns, (1e-3, 0.0, recording.bench.resolution), strict=True
    ):
        made = recording.columns[name]
        # A rounding error elsewhere may turn a position that lies between two counts.
        assert np.max(np.abs(stored - made)) <= 1.001 * grid + 1e-9, name
        assert np.mean(np.abs(stored - made) > 0.5 * grid + 1e-9) < 1e-3, name
    assert entry.path.stat().st_size < 400_000


def test_the_page_states_the_truth_and_every_file() -> None:
    page = (DATA / "README.md").read_text(encoding="utf-8")
    assert MADE.table() in page
    files = {path.name for path in (DATA / "recordings").iterdir()}
    assert files == {entry.path.name for entry in MADE.ENTRIES}


@pytest.mark.parametrize("device", ["lhifam", "phantom"])
def test_device_files_hold_the_papers_tables(device: str) -> None:
    tables = tomllib.loads((DATA / "paper-tables.toml").read_text(encoding="utf-8"))[device]
    found = load_device(device)
    for structure in ("free", "grasped"):
        published = dict(tables[structure])
        assert found.delay_s == published.pop("delay_s")
        assert dict(found.parameters[structure]) == published
