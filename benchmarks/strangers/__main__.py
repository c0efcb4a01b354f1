"""Recordings of another simulation, with effects that nobody declared: what becomes of each?

    python -m benchmarks.strangers [COUNT] [FIRST] [FILE]

Devices like those of Diaz and Gil and new ones, free and held, seven excitations, 6 to 40 s, none,
one or two of 24 effects, some of them of no kind that the library knows; half of the known devices
with their device file.  Each recording takes the whole way to a recommendation.  FILE
keeps what is done, a line a recording: a run that was stopped goes on from there.
"""

from __future__ import annotations

import argparse
import json
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.errors import InputError
from bayeshaptic.report.headline import headline
from benchmarks.strangers.draw import Case
from benchmarks.strangers.recordings import make

Row = dict[str, Any]


def analysed(case: Case | None) -> dict[str, Any]:
    """What became of a recording; limits over the truth."""
    if case is None:
        return {"outcome": "ran away"}
    found: dict[str, Any] = {"what": case.what, "effects": case.effects}
    found["file"] = "device" in case.told
    began = time.process_time()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            found |= _of(close_loop(case.recording, **case.told), case)
        except InputError as error:
            found |= {"outcome": "refused", "why": str(error)}
        except Exception:
            found |= {"outcome": "DEFECT", "why": traceback.format_exc()}
    found["warned"] = sorted({str(warning.message) for warning in told})
    found["seconds"] = time.process_time() - began
    return found


def _of(closed: Closed, case: Case) -> dict[str, Any]:
    told = headline(closed)
    limit = closed.analysis.limit.quantile(np.array([0.05, 0.5, 0.95])) / case.truth
    return {
        "outcome": "refused" if told.status == "untrusted" else "recommended",
        "why": told.sentence,
        "model": closed.analysis.model.name,
        "verdict": closed.verdict,
        "found": closed.effect_names,
        "limit": [float(value) for value in limit],
        "left": [
            f"{test.name} {test.statistic:.1f}/{test.usual or test.threshold:.1f}"
            for test in closed.traced.after
            if test.excess > 0.6 or test.noticed
        ],
        "estimates": {
            name: [one.mean, one.sd]
            for effect in closed.effects
            for name, one in effect.estimates.items()
        },
        "stiffness": None if told.stiffness is None else float(told.stiffness / case.truth),
        "parameters": _intervals(closed, case),
        "left open": [
            name for name, left in closed.analysis.stated.prior_dominated.items() if left
        ],
    }


def _intervals(closed: Closed, case: Case) -> dict[str, list[float]]:
    """90 % intervals over the truth; none where the base model is another than the device."""
    if closed.base.model.name != case.base:
        return {}
    stated = closed.analysis.stated
    ends = dict(zip(stated.names, stated.quantile(np.array([0.05, 0.95])).T, strict=True))
    return {n: (ends[n] / value).tolist() for n, value in case.parameters.items() if n in ends}


def line(row: dict[str, Any]) -> str:
    """One recording in a line."""
    if row["outcome"] == "ran away":
        return f"{row['seed']:4d} ran away"
    inside = ", ".join(row["effects"]) or "nothing"
    text = f"{row['seed']:4d} {row['what']} | {inside} | {row['outcome']}"
    if "limit" in row:
        low, middle, high = row["limit"]
        named = ", ".join(row["found"]) or "nothing"
        text += f" {row['model']}, {row['verdict']}: {named}, {low:.3g} {middle:.3g} {high:.3g}"
        if row["stiffness"] is not None:
            text += f", stiffness {row['stiffness']:.3g}"
        if row["outcome"] == "recommended" and (row["stiffness"] or 0) > 1:
            text += " ABOVE"
    if row["outcome"] != "recommended":
        text += f" ({row['why'].splitlines()[-1][:90]})"
    return f"{text}, {row['seconds']:.1f} s {' '.join(row['warned'])}"


def summary(rows: list[dict[str, Any]]) -> None:
    """How many were recommended, and what the intervals held, with and without a device file."""
    rows = [row for row in rows if row["outcome"] != "ran away"]
    print(f"\n{len(rows)} recordings, stiffness and limit over the truth")
    for label, some in (
        ("all", rows),
        ("with a device file", [row for row in rows if row["file"]]),
        ("without", [row for row in rows if not row["file"]]),
        ("nothing in them", [row for row in rows if not row["effects"]]),
    ):
        given = [row for row in some if row["outcome"] == "recommended"]
        if not given:
            continue
        limits = np.array([row["limit"] for row in given])
        inside = np.mean((limits[:, 0] <= 1) & (limits[:, 2] >= 1))
        above = sum(row["stiffness"] is not None and row["stiffness"] > 1 for row in given)
        width = np.median(20 * np.log10(limits[:, 2] / limits[:, 0]))
        seconds = np.array([row["seconds"] for row in some])
        print(
            f"{label}: {len(some)}, recommended {len(given)}, 90 % intervals hold "
            f"{100 * inside:.0f} %, wholly above {np.sum(limits[:, 0] > 1)}, below "
            f"{np.sum(limits[:, 2] < 1)}, median width {width:.2f} dB; stiffness above the truth "
            f"{above}; CPU s median {np.median(seconds):.1f}, worst {seconds.max():.0f}"
        )
    for verdict in ("consistent", "explained", "unexplained"):
        some = [row for row in rows if row.get("verdict") == verdict]
        known = [ends for row in some for ends in row.get("parameters", {}).values()]
        inside = sum(row["limit"][0] <= 1 <= row["limit"][2] for row in some)
        print(
            f"{verdict}: 90 % intervals hold {inside} of {len(some)} limits and "
            f"{sum(low <= 1 <= high for low, high in known)} of {len(known)} parameters"
        )
    for name in dict.fromkeys(name for row in rows for name in row.get("parameters", ())):
        told = [row for row in rows if name in row.get("parameters", ())]
        known = [row["parameters"][name] for row in told if name not in row["left open"]]
        inside = sum(low <= 1 <= high for low, high in known)
        print(f"{name}: 90 % intervals hold {inside} of {len(known)}, {len(told)} with those open")
    defects = [row["seed"] for row in rows if row["outcome"] == "DEFECT"]
    print(f"defects: {defects or 'none'}; warnings: {[r['seed'] for r in rows if r['warned']]}")


def run(what: str | None, made: Callable[[int], Case | None]) -> None:
    """What becomes of the recordings that are made of as many seeds as the command line says."""
    kept(parser_of(what).parse_args(), lambda seed: {"seed": seed} | analysed(made(seed)))


def kept(asked: argparse.Namespace, found: Callable[[int], Row]) -> None:
    """What becomes of each seed, a line each, then the table; the file keeps what is done."""
    rows: dict[int, Row] = {}
    seeds, path = range(asked.first, asked.first + asked.count), asked.file
    if path and path.exists():
        rows = {row["seed"]: row for row in map(json.loads, path.read_text().splitlines())}
    for seed in seeds:
        if seed not in rows:
            rows[seed] = found(seed)
            if path:
                with path.open("a") as file:
                    file.write(json.dumps(rows[seed]) + "\n")
        print(line(rows[seed]), flush=True)
    summary([rows[seed] for seed in seeds])


def parser_of(what: str | None) -> argparse.ArgumentParser:
    """How many recordings, from which seed on, and the file that keeps them."""
    parser = argparse.ArgumentParser(description=what)
    parser.add_argument("count", nargs="?", type=int, default=40)
    parser.add_argument("first", nargs="?", type=int, default=0)
    parser.add_argument("file", nargs="?", type=Path)
    return parser


if __name__ == "__main__":
    run(__doc__, make)
