"""``bayeshaptic inspect``: what is in a file, and how to read it."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bayeshaptic.errors import InputError, printable, refuse_place
from bayeshaptic.files import resolved, whole_file, write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from bayeshaptic.recordings.overview.overview import Overview
    from bayeshaptic.recordings.overview.roles import ColumnFacts

NAME = "inspect"
SUMMARY = "what is in a file, and a --columns line to read it with"
DESCRIPTION = """\
List the columns of a file: how many samples, their range, resolution (an encoder's count) and rate,
what each may be, and what it looks like over time. The line for --columns is a guess by names and
by what the numbers do; look at it before you use it. In a terminal --write asks about each."""
EXAMPLES = """\
  bayeshaptic inspect bench.mat
  bayeshaptic inspect bench.mat --png bench.png --write study.toml"""

OUTSIDE = " (its recording is outside its folder: report it with --allow-outside, or move one)"
_JOINED = (
    "write both into one table, a row for each command, with the position that was read for it "
    "(by time, if the two have one clock)"
)
_BARS = "▁▂▃▄▅▆▇█"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The file, and what to write."""
    parser.add_argument("recording", type=Path, metavar="FILE", help="a recording of any format")
    parser.add_argument("--png", type=Path, metavar="FILE", help="draw the columns over time")
    parser.add_argument(
        "--write", type=Path, metavar="STUDY", help="write a study (.toml) with this file, to edit"
    )
    parser.add_argument("--force", action="store_true", help="overwrite what exists")


def run(arguments: argparse.Namespace) -> int:
    """Print the columns; 0."""
    from bayeshaptic.recordings.overview.overview import overview

    for path, example in ((arguments.png, "columns.png"), (arguments.write, "study.toml")):
        if path is None:
            continue
        refuse_place(path, example)
        if path.exists() and path.samefile(arguments.recording):
            raise InputError(f"{path} is the recording itself; name another file to write")
        if path.suffix.lower() != Path(example).suffix:
            raise InputError(f"{path}: give a name that ends in {Path(example).suffix}")
        if path.exists() and not arguments.force:
            raise InputError(f"{path} exists; name another file, or overwrite it with --force")
    found = overview(arguments.recording)
    for line in lines(found):
        print(line)
    if arguments.png is not None:
        draw(found, arguments.png)
        print(f"picture: {arguments.png}")
    if arguments.write is not None:
        ask = sys.stdin.isatty() and sys.stdout.isatty() and not found.of_a_response
        mapping = asked(found) if ask else found.mapping
        text = study_text(found, arguments.write, mapping)
        write_whole(arguments.write, text)
        file, folder = resolved(found.path), resolved(arguments.write).parent
        beyond = "" if file.is_relative_to(folder) else OUTSIDE
        print(f"study: {arguments.write}{beyond}")
    return 0


def lines(found: Overview) -> list[str]:
    """The table, the doubts, and the suggested line."""
    most_columns = 40
    shown = found.columns[:most_columns]
    table = _table(shown, found)
    if len(found.columns) > len(shown):
        table.append(f"and {len(found.columns) - len(shown)} more")
    texts = (_text_in(one, found) for one in shown)
    return [*table, *_doubts(found), *filter(None, texts), *_how_to_read(found)]


def _table(shown: Sequence[ColumnFacts], found: Overview) -> list[str]:
    """A line a column, below their heads."""
    roles = {name: role for role, name in found.roles.items()}
    width = max(len("name"), *(len(printable(one.name)) for one in shown))
    table = [f"{'name':{width}}  samples  {'low to high':^24}  resolution"]
    for one in shown:
        step = f"{one.resolution:.4g}" if one.resolution else "-"
        rate = f"  every {one.period:.6g}" if one.period else ""
        picture = "" if one.period else f"  {_sparkline(found.arrays[one.name])}"
        role = f"  {roles[one.name]}?" if one.name in roles else ""
        name, span = printable(one.name), f"{one.low:10.4g} to {one.high:<10.4g}"
        span = f"{'-':^24}" if one.low != one.low else span
        table.append(f"{name:{width}}  {one.samples:7d}  {span}  {step:>10}{rate}{picture}{role}")
    return table


def _doubts(found: Overview) -> list[str]:
    """What a person should look at before the guesses are used."""
    from bayeshaptic.recordings.overview.overview import doubts, is_guess
    from bayeshaptic.recordings.overview.roles import is_measured

    told = []
    by_name = {one.name: one for one in found.columns}
    for role, name in found.roles.items():
        said = [doubts(by_name[name], role)]
        if is_guess(by_name[name], role):
            rough = "roughest" if role == "force" else "smoothest"
            said.insert(0, f"a guess, the {rough} signal: look whether it is")
        if role == "force" and is_measured(name):
            said.insert(0, "measured, not commanded? Then write measured_force= for force=")
        if text := "; ".join(filter(None, said)):
            told.append(f"{role}: {printable(name)}: {text}")
    return told


def _how_to_read(found: Overview) -> list[str]:
    """The options that the file is read with, or what there is too little of for them."""
    from bayeshaptic.recordings.columns import POSITIONS

    if found.of_a_response:
        return ["a table of a frequency response, read as it is: give --period-s SECONDS"]
    if found.mapping is not None:
        period = "" if "time" in found.roles else " --period-s SECONDS"
        return [f"--columns {_quoted(printable(found.mapping))}{period}"]
    needed = {"force": ("force",), "position": POSITIONS}
    missing = [what for what, any_of in needed.items() if not set(any_of) & set(found.roles)]
    was = "was" if len(missing) == 1 else "were"
    told = [f"no {' and '.join(missing)} {was} recognised; name them with --columns"]
    if len(missing) == 1:
        told.append(f"a {missing[0]} that stands in another file: {_JOINED}")
    return told


def _text_in(column: ColumnFacts, found: Overview) -> str | None:
    """Where a column of numbers holds text, as a second header in the middle; None elsewhere."""
    from bayeshaptic.recordings.readers.numbers import as_numbers

    values = found.arrays[column.name]
    first = values[:1]
    try:
        as_numbers(first, "")
        as_numbers(values, printable(column.name))
    except InputError as error:
        return None if str(error).startswith(":") else str(error)
    return None


def _quoted(text: str) -> str:
    """For a shell: in double quotes, which all know, or in single ones where they stand in it."""
    return shlex.quote(text) if set(text) & set('"$`\\!') else f'"{text}"'


def asked(found: Overview) -> str:
    """The mapping as somebody at the terminal wants it: a line each, empty for the guess."""
    from bayeshaptic.recordings.columns import POSITIONS

    guesses = dict(part.split("=", 1) for part in (found.mapping or "").split(",") if part)
    chosen: dict[str, str] = {}
    print("Which columns are these? NAME, NAME*FACTOR or NAME*FACTOR[UNIT]; empty for the guess.")
    motion = next((role for role in POSITIONS if role in found.roles), "position")
    for role in ("time", "force", motion):
        if term := _asked_for(role, guesses.get(role, ""), tuple(chosen.values()), found):
            chosen[role] = term
    return ",".join(f"{role}={term}" for role, term in chosen.items())


def _asked_for(role: str, guess: str, taken: tuple[str, ...], found: Overview) -> str:
    """The term for a role, asked until it can be read; empty where the period is given instead."""
    from bayeshaptic.recordings.columns import parse_columns
    from bayeshaptic.recordings.overview.overview import unit_of

    while True:
        term = _answer(f"  {role} [{printable(guess or '-')}]: ") or guess
        if not term and role == "time":
            return ""
        try:
            unit_of(found, role, term)
            name, *others = (parse_columns({role: each})[role].names[-1] for each in (term, *taken))
            if name in others:
                raise InputError("this column has a role already")
        except InputError as error:
            print(f"  {printable(str(error))}")
        else:
            return term


def _answer(question: str) -> str:
    try:
        return input(question).strip()
    except EOFError:
        raise InputError("no answer; nothing was written") from None


def study_text(found: Overview, path: Path, mapping: str | None) -> str:
    """A study with this one recording, its columns as in `mapping`."""
    from bayeshaptic.recordings.overview.overview import UNIT_TO_SAY, unit_of

    terms = dict(part.split("=", 1) for part in (mapping or "").split(",") if part)
    said = {role: term for role, term in terms.items() if not term.endswith(UNIT_TO_SAY)}
    units = {unit_of(found, role, term) for role, term in said.items() if role != "time"}
    kind, other = "translational", "rotational"
    if units & {"Nm", "rad"}:
        kind, other = other, kind
    columns = f"""\
# A guess: check the names, and write factors and units, as in position=enc*3.14e-6[m].
columns = {_toml(mapping or "time=...,force=...,position=...")}"""
    if found.of_a_response:
        columns = "period_s = 1e-3                 # of the loop: a table does not say it"
    file = os.path.relpath(resolved(found.path), resolved(path).parent).replace(os.sep, "/")
    return f"""\
# A study: one device and all its recordings. See docs/file-formats.md.
[device]
name = "my device"
kind = {f'"{kind}"':24} # or "{other}"
# delay_s = 200e-6              # loop delay beyond the hold
# encoder_resolution = 3.14e-6  # one count, in m or rad
{columns}

[[recording]]
file = {_toml(file)}
# user = "Anna"                 # nobody holds the device where there is no user
"""


def _toml(text: str) -> str:
    """Text in quotes; TOML has no name for bytes that are no UTF-8."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise InputError(f"{text}: a study cannot name what is no UTF-8; rename it") from None
    return json.dumps(text, ensure_ascii=False)


def draw(found: Overview, path: Path) -> None:
    """The columns one above the other, as a PNG."""
    from bayeshaptic.report.figures.drawing.look import own_look

    with own_look(), whole_file(path) as partial:
        _drawn(found).savefig(partial, format="png")


def _drawn(found: Overview) -> Figure:
    from bayeshaptic.report.figures.style import new_figure, panel

    numbers = [one for one in found.columns if one.samples > 2 and one.roughness > 0]
    named = [one for one in numbers if one.name in found.roles.values()]
    others = [one for one in numbers if one.name not in found.roles.values()]
    shown = [*named, *others][:12]
    if not shown:
        raise InputError(f"{found.path}: no column of numbers to draw")
    figure = new_figure(1.2 * len(shown) + 0.4)
    clock, unit = _clock(found)
    for number, one in enumerate(shown, start=1):
        axes = figure.add_subplot(len(shown), 1, number)
        values = found.arrays[one.name]
        over = clock if clock is not None and len(clock) == len(values) else range(len(values))
        panel(axes, unit if number == len(shown) else "", title=printable(one.name))
        axes.plot(over, values, linewidth=0.5)
    return figure


def _clock(found: Overview) -> tuple[Any, str]:
    name = found.roles.get("time")
    return (None, "row") if name is None else (found.arrays[name], printable(name))


def _sparkline(values: Any) -> str:
    """The column over time in one line of text, each place a sample from there."""
    import numpy as np

    if values.dtype.kind not in "iufb" or not np.isfinite(values).any():
        return "text" if values.dtype.kind not in "iufb" else ""
    width = 32
    at = np.linspace(0, len(values) - 1, min(width, len(values))).astype(int)
    some = np.nan_to_num(np.asarray(values, dtype=float)[at])
    low, high = some.min(), some.max()
    level = (some - low) / (high - low or 1.0)
    return "".join(_BARS[int(round(7 * share))] for share in level)
