"""The examples do what they say; the recordings of the example study are what its script makes."""

from __future__ import annotations

import gzip
import re
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest
from example_script import EXAMPLES, load

from bayeshaptic import read_study


@pytest.fixture(scope="module")
def study_script() -> ModuleType:
    return load(EXAMPLES / "study" / "make_recordings.py")


def test_the_study_names_every_recording_with_its_user_and_configuration(
    study_script: ModuleType,
) -> None:
    study = read_study(EXAMPLES / "study" / "study.toml")
    declared = {e.path.name: (e.user, e.configuration) for e in study.entries}
    made = {e.path.name: (e.bench.user, e.stretched) for e in study_script.entries()}
    assert declared == made
    assert len(study.users) == 6 and sum(user is None for user, _ in made.values()) == 4
    (reference,) = study.references
    assert len(reference.critical_stiffness) == 6


@pytest.mark.parametrize("number", [0, 7])
def test_a_recording_of_the_study_is_what_its_script_makes(
    study_script: ModuleType, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study_script, "FOLDER", tmp_path)
    entry = study_script.entries()[number]
    made = gzip.decompress(study_script.record(entry).read_bytes())
    kept = EXAMPLES / "study" / "recordings" / entry.path.name
    assert made == gzip.decompress(kept.read_bytes())


def test_the_truth_in_the_readme_is_that_of_the_bench(study_script: ModuleType) -> None:
    text = (EXAMPLES / "study" / "README.md").read_text(encoding="utf-8")
    assert study_script.table() in text


def test_the_walk_through_of_an_undeclared_effect() -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / "undeclared_effect.py"), "--ess", "300"],
        capture_output=True,
        text=True,
        timeout=300,
        check=True,
    )
    lines = done.stdout.splitlines()
    assert any(line.startswith("2. nonlinear") for line in lines)
    assert any("friction" in line and line.endswith("accepted") for line in lines)
    (force,) = re.findall(r"friction_force ([\d.]+)", done.stdout)
    assert float(force) == pytest.approx(0.6, rel=0.1)
    before, after = (
        float(value) for value in re.findall(r"held-out error ([\d.]+) times", done.stdout)
    )
    # A quarter of some 100 windows of three complex numbers scatters by 6 per cent.
    assert after < before and after == pytest.approx(1.0, abs=0.25)
