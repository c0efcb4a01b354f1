"""The index of a batch: `index.html`, `index.csv` and `failed.csv`."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bayeshaptic.files import write_whole
from bayeshaptic.quantities import quantity, rounded_down, spread_of
from bayeshaptic.report.page.frame import finished, frame, template
from bayeshaptic.report.page.lights import BAD, DOUBT, GOOD, SIGNS

COLUMNS = {
    "name": "Recording",
    "device": "Device",
    "user": "User",
    "configuration": "Configuration",
    "status": "Status",
    "safe": "Safe at 1 %",
    "q05": "K_CR 5 %",
    "q50": "K_CR median",
    "q95": "K_CR 95 %",
    "unit": "Unit",
    "frequency_hz": "Frequency",
    "verdict": "Verdict",
    "error": "Error",
}
FILES = ("index.html", "index.csv", "failed.csv")
_NUMBERS = ("safe", "q05", "q50", "q95", "frequency_hz")
# A sign for where there is no colour, and the class of the page's style.
_LIGHTS = {
    "safe": (SIGNS[GOOD], GOOD),
    "caution": (SIGNS[DOUBT], DOUBT),
    "untrusted": (SIGNS[BAD], BAD),
    "failed": ("\N{EM DASH}", BAD),
}


def row_of(name: str, folder: Path, status: str | None, error: str | None) -> dict[str, Any]:
    """One line of the index, from the report's own numbers in `folder`."""
    row: dict[str, Any] = dict.fromkeys(COLUMNS)
    row |= {"name": name, "status": status or "failed", "error": error, "folder": str(folder)}
    if error is not None:
        return row
    try:
        summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return row | _of_study(folder)
    limit, recording = summary["critical_stiffness"], summary["recording"]
    return row | {
        "device": recording["device"],
        "user": recording["user"],
        "configuration": recording["configuration"],
        "safe": _safe(summary["recommendation"], limit["safe"]),
        **{name: limit[name] for name in ("q05", "q50", "q95", "unit")},
        "frequency_hz": limit["frequency_hz"]["q50"],
        "verdict": (summary["diagnosis"] or {}).get("verdict"),
    }


def _safe(said: Mapping[str, Any], safe: Mapping[str, Any]) -> float | None:
    """The stiffness at 1 % risk; what the measurement asks for where that is lower, or nothing."""
    if said["status"] == "untrusted":
        return None
    if said["stiffness"] is not None and said["risk"] is None:
        return float(said["stiffness"])
    stiffness: float | None = safe.get("0.01")
    return stiffness


def _of_study(folder: Path) -> dict[str, Any]:
    try:
        population = json.loads((folder / "population.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    limit = population.get("device_limit") or {}
    safe = _safe(population["recommendation"], limit.get("safe") or {})
    known = {key: limit.get(key) for key in ("q05", "q50", "q95", "unit")}
    return {"device": population.get("device"), "safe": safe, **known}


def write_index(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `index.html`, `index.csv`, and `failed.csv` where anything failed."""
    failed = [row for row in rows if row["error"] is not None]
    write_whole(folder / "index.csv", _table(rows, tuple(COLUMNS)))
    if failed:
        write_whole(folder / "failed.csv", _table(failed, ("name", "folder", "error")))
    else:
        (folder / "failed.csv").unlink(missing_ok=True)
    page = template("index.jinja").render(
        **frame(),
        title=folder.name,
        failed=len(failed),
        columns={key: COLUMNS[key] for key in _shown_columns(rows)},
        numbers=_NUMBERS,
        rows=[_shown(row, folder) for row in rows],
    )
    write_whole(folder / "index.html", finished(page))


def _shown_columns(rows: Sequence[Mapping[str, Any]]) -> tuple[str, ...]:
    """Of the page: what is to be known first comes first, and what no row has stays out."""
    first = ("name", "status", "safe")
    order = (*first, *(key for key in COLUMNS if key not in first and key != "unit"))
    return tuple(key for key in order if any(row[key] is not None for row in rows))


def _table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _number(row: Mapping[str, Any], key: str) -> str:
    """With the digits of the report's own page."""
    value, unit = float(row[key]), row["unit"] or ""
    if key == "frequency_hz":
        return quantity(value, "Hz", digits=4)
    low, high = (value if row[end] is None else float(row[end]) for end in ("q05", "q95"))
    if key == "safe":
        return rounded_down(value, unit, low, high).text
    return quantity(value, unit, spread_of(low, high))


def _shown(row: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """A row as the page shows it: (text, what to sort by) of each column, its light, its report."""
    cells = {}
    for key in COLUMNS:
        value = row[key]
        text = "" if value is None else str(value)
        if key in _NUMBERS:
            text = "" if value is None else _number(row, key)
        cells[key] = (text, "" if value is None else value)
    page = None
    if row["error"] is None:
        page = Path(os.path.relpath(Path(row["folder"]) / "report.html", folder)).as_posix()
    sign, light = _LIGHTS.get(str(row["status"]), _LIGHTS["failed"])
    return {"cells": cells, "page": page, "sign": sign, "light": light}
