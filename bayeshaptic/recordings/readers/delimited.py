"""CSV and its relatives: separators, comments, byte-order marks and decimal commas."""

from __future__ import annotations

import csv
import gzip
import io
import re
import zlib
from pathlib import Path

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.reader import Arrays, Reader

_NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.I)


def read_delimited(path: Path) -> Arrays:
    """The columns of a text file of numbers.

    Comma, semicolon, tab or blanks between the fields; lines that start with ``#`` are comments; a
    decimal comma is understood where the separator is another one. Without a header line the
    columns are named "1", "2" and so on. A column with text in it stays text.

    Raises
    ------
    InputError
        For a file that is empty, not text, has a header but no rows, or a row with more or fewer
        fields than the first (by its line number).
    """
    lines = [
        (number, line)
        for number, line in enumerate(_text(path).splitlines(), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise InputError(f"{path}: the file is empty")
    separator = _separator(lines[min(1, len(lines) - 1)][1])
    names = _header(lines[0][1], separator)
    if names is None:
        names = [str(i) for i in range(1, len(_fields(lines[0][1], separator)) + 1)]
    else:
        lines = lines[1:]
        if not lines:
            raise InputError(f"{path}: a header ({', '.join(names)}) but no rows of numbers")
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise InputError(f"{path}: the header has '{twice.pop()}' more than once; rename one")
    if separator != ",":
        lines = [(number, line.replace(",", ".")) for number, line in lines]
    return _numbers(lines, separator, names) or _mixed(path, lines, separator, names)


def _text(path: Path) -> str:
    try:
        content = path.read_bytes()
        if content.startswith(b"\x1f\x8b"):
            content = gzip.decompress(content)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be unpacked or read ({error})") from None
    if b"\0" in content:
        raise InputError(f"{path}: not a text file; its name should end as its format does")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _separator(line: str) -> str | None:
    """The field separator of a row; None stands for any run of blanks."""
    for separator in ("\t", ";", ","):
        if separator in line:
            return separator
    return None


def _fields(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [field.strip('"') for field in line.split()]
    (fields,) = csv.reader(io.StringIO(line), delimiter=separator, skipinitialspace=True)
    return [field.strip() for field in fields]


def _header(line: str, separator: str | None) -> list[str] | None:
    """Column names, or None where the line is numbers already."""
    fields = _fields(line, separator)
    return None if any(_NUMBER.fullmatch(field) for field in fields) else fields


def _numbers(
    lines: list[tuple[int, str]], separator: str | None, names: list[str]
) -> Arrays | None:
    """The fast way, for tables of nothing but numbers."""
    try:
        table = np.loadtxt(
            [line for _, line in lines], delimiter=separator, ndmin=2, quotechar='"', comments=None
        )
    except ValueError:
        return None
    if table.shape[1] != len(names):
        return None
    return dict(zip(names, np.ascontiguousarray(table.T), strict=True))


def _mixed(
    path: Path, lines: list[tuple[int, str]], separator: str | None, names: list[str]
) -> Arrays:
    """The slow way, column by column; tells which line does not fit."""
    rows = []
    for number, line in lines:
        fields = _fields(line, separator)
        # Many programs end every row with a separator.
        if len(fields) == len(names) + 1 and fields[-1] == "":
            fields = fields[:-1]
        if len(fields) != len(names):
            raise InputError(
                f"{path}: line {number} has {len(fields)} fields where {len(names)} are expected "
                f"({', '.join(names)}); is the file cut off, or the separator another one?"
            )
        rows.append(fields)
    columns: Arrays = {}
    for name, column in zip(names, np.array(rows).T, strict=True):
        try:
            columns[name] = column.astype(float)
        except ValueError:
            columns[name] = column
    return columns


READER = Reader("CSV", (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz"), read_delimited)
