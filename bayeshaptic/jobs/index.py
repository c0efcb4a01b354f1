"""The index of a batch: `index.html`, `index.csv` and `failed.csv`."""

from __future__ import annotations

import csv
import io
import json
import os
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from bayeshaptic.files import write_whole

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
    "frequency_hz": "Hz",
    "verdict": "Verdict",
    "error": "Error",
}
_NUMBERS = ("safe", "q05", "q50", "q95", "frequency_hz")
_LIGHTS = {"safe": "#2e7d32", "caution": "#f9a825", "untrusted": "#c62828", "failed": "#616161"}

_PAGE = """<!DOCTYPE html>
<html lang="en"><meta charset="utf-8"><title>bayeshaptic: {title}</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<style>
body {{ font: 14px/1.4 system-ui, sans-serif; margin: 2em; color: #1a1a1a }}
table {{ border-collapse: collapse }}
th, td {{ padding: .25em .7em; border-bottom: 1px solid #ddd; text-align: left }}
th {{ cursor: pointer; position: sticky; top: 0; background: white }}
td.number {{ text-align: right; font-variant-numeric: tabular-nums }}
i {{ display: inline-block; width: .7em; height: .7em; border-radius: 50%; margin-right: .4em }}
</style>
<h1>{title}</h1>
<p>{count} rows, {failed} failed. Stiffness in the unit of each row; a click on a heading sorts.</p>
<table><thead><tr>{heads}</tr></thead><tbody>
{rows}
</tbody></table>
<script>
document.querySelectorAll("th").forEach((head, i) => head.onclick = () => {{
  const body = document.querySelector("tbody");
  const down = head.dataset.down = -(head.dataset.down || -1);
  const value = row => {{ const text = row.cells[i].dataset.value;
    return text === "" ? null : isNaN(text) ? text : Number(text); }};
  [...body.rows].sort((a, b) => {{ const [x, y] = [value(a), value(b)];
    return x === null ? 1 : y === null ? -1 : down * (x > y ? 1 : x < y ? -1 : 0); }})
    .forEach(row => body.append(row));
}});
</script></html>
"""


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
        "safe": limit["safe"].get("0.01"),
        **{name: limit[name] for name in ("q05", "q50", "q95", "unit")},
        "frequency_hz": limit["frequency_hz"]["q50"],
        "verdict": (summary["diagnosis"] or {}).get("verdict"),
    }


def _of_study(folder: Path) -> dict[str, Any]:
    try:
        population = json.loads((folder / "population.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    limit = population.get("device_limit") or {}
    return {"device": population.get("device"), "safe": (limit.get("safe") or {}).get("0.01")}


def write_index(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `index.html`, `index.csv`, and `failed.csv` where anything failed."""
    failed = [row for row in rows if row["error"] is not None]
    write_whole(folder / "index.csv", _table(rows, tuple(COLUMNS)))
    if failed:
        write_whole(folder / "failed.csv", _table(failed, ("name", "folder", "error")))
    else:
        (folder / "failed.csv").unlink(missing_ok=True)
    page = _PAGE.format(
        title=escape(folder.name),
        count=len(rows),
        failed=len(failed),
        heads="".join(f"<th>{escape(title)}</th>" for title in COLUMNS.values()),
        rows="\n".join(_line(row, folder) for row in rows),
    )
    write_whole(folder / "index.html", page)


def _table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _line(row: Mapping[str, Any], folder: Path) -> str:
    cells = []
    for key in COLUMNS:
        value = row[key]
        text = "" if value is None else f"{value:.4g}" if key in _NUMBERS else escape(str(value))
        if key == "name" and row["error"] is None:
            page = Path(os.path.relpath(Path(row["folder"]) / "report.html", folder)).as_posix()
            text = f'<a href="{escape(page)}">{text}</a>'
        if key == "status":
            text = f'<i style="background:{_LIGHTS.get(str(value), "#616161")}"></i>{text}'
        kind = ' class="number"' if key in _NUMBERS else ""
        shown = "" if value is None else escape(str(value))
        cells.append(f'<td{kind} data-value="{shown}">{text}</td>')
    return f"<tr>{''.join(cells)}</tr>"
