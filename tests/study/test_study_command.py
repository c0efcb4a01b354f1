"""A small study through the whole command: recordings in, one report of the device out."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from bayeshaptic import cli
from bayeshaptic.inference.population import sampler as population_sampler
from bayeshaptic.jobs import recording as recording_job
from bayeshaptic.report.study import write as study_report
from bayeshaptic.report.walls.section import table_of
from bayeshaptic.rig import Bench, WhiteNoise, simulate, write_recording
from bayeshaptic.study import analysis as study_analysis

SECONDS = 4.0
STUDY = """
[device]
name = "phantom"
[[reference]]
label = "somebody else's"
critical_stiffness_db = 41.0
"""


def held_by(user: str, factor: float) -> Bench:
    """Table I's PHANToM in a hand whose springs are so many times as stiff."""
    bench = Bench.from_device("phantom", held=True)
    values = {n: v * (factor if n in ("ks", "kh") else 1.0) for n, v in bench.values.items()}
    return replace(bench, values=values, user=user)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nobody and two people, four seconds each, and a file that is no recording."""
    place = tmp_path_factory.mktemp("study")
    text = STUDY
    benches = {
        "free": Bench.from_device("phantom"),
        "ana": held_by("ana", 1.0),
        "bob": held_by("bob", 1.3),
    }
    for number, (name, bench) in enumerate(benches.items()):
        made = simulate(bench, WhiteNoise(0.1, 200.0, 0.7, SECONDS), seed=number)
        write_recording(place / f"{name}.csv", made)
        user = f'user = "{bench.user}"\n' if bench.user else ""
        text += f'[[recording]]\nfile = "{name}.csv"\n{user}'
    (place / "broken.csv").write_text("nothing\n")
    (place / "study.toml").write_text(text + '[[recording]]\nfile = "broken.csv"\nuser = "cem"\n')
    return place


def test_a_study_through_the_command(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    analyse = study_analysis.analyse
    monkeypatch.setattr(study_analysis, "analyse", lambda *a, **b: analyse(*a, **b | {"ess": 200}))
    monkeypatch.setattr(study_report, "table_of", partial(table_of, draws=60))
    monkeypatch.setattr(population_sampler, "_MOST_STEPS", 60)
    monkeypatch.setattr(recording_job, "write_report", _only_the_summary)
    out = tmp_path / "out"
    arguments = [
        "report",
        str(folder / "study.toml"),
        "--no-loop",
        "--workers",
        "1",
        "-o",
        str(out),
    ]
    assert cli.main(arguments) == 1  # one recording failed
    said = capsys.readouterr()
    assert "error: broken: " in said.err and said.err.count("\n") == 1
    assert said.out.splitlines()[-1] == f"  report: {out / 'report.html'}"
    found = json.loads((out / "population.json").read_text(encoding="utf-8"))
    assert found["device"] == "phantom" and found["recordings"] == 3
    assert {"ana", "bob"} <= {user["user"] for user in found["users"]}
    # With nobody holding it the PHANToM is worse, as in the paper: 22.4 against some 41 dB.
    assert found["device_limit"]["binding"][0]["case"] == "nobody holds it"
    assert found["device_limit"]["binding"][0]["probability"] > 0.95
    person = found["new_person"]["critical_stiffness"]
    assert person["db"]["q05"] < 40.92 < person["db"]["q95"]
    page = (out / "report.html").read_text(encoding="utf-8")
    for name in ("free", "ana", "bob"):
        assert f'href="{name}/report.html"' in page
    assert "broken failed." in page and "Triangles: limits known from elsewhere" in page
    limits = json.loads((out / "limits.json").read_text(encoding="utf-8"))
    assert limits["device"] == "phantom" and limits["cases"]


def _only_the_summary(result: Any, folder: Path, origin: Any = None) -> Path:
    """In the place of a recording's report, which other tests look at."""
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("<!DOCTYPE html>")
    return folder / "report.html"
