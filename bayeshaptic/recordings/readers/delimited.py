"""CSV and its relatives: separators, encodings, comments, preambles and decimal commas."""

from __future__ import annotations

import codecs
import contextlib
import csv
import io
import re
import zlib
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.layout import NUMBER, find_layout
from bayeshaptic.recordings.readers.numbers import THOUSANDS
from bayeshaptic.recordings.readers.packed import opened
from bayeshaptic.recordings.readers.reader import MOST_TEXT, Arrays, Reader
from bayeshaptic.recordings.units import is_unit
from bayeshaptic.types import Floats

Lines = list[tuple[int, str]]

# Where a field was left empty, or something was written for nothing.
_MISSING = ("", "-", "--", "na", "n/a", "#n/a", "null", "none")
# Without hours, as spreadsheets show short times, the seconds have a fraction: 12:34 may be hours.
_CLOCK = re.compile(
    r".*?(?:(\d{1,2}):(\d\d):(\d\d(?:[.,]\d*)?)|(\d{1,2}):(\d\d[.,]\d+))"
    r"\s*(?:[ap]\.?m\.?|z|[-+]\d\d:?\d\d)?",
    re.I,
)
_WITH_UNIT = re.compile(rf"(?P<number>{NUMBER.pattern})\s*(?P<unit>[^\W\d]\S*)", re.I)
_POINT = re.compile(r"[-+]?(\d+\.\d*|\.\d+)([eE][-+]?\d+)?")
_DECLARED = re.compile(r'"?sep=(?P<separator>[^"])"?', re.I)


def read_delimited(path: Path) -> Arrays:
    """The columns of a text file of numbers.

    Comma, semicolon, tab, | or blanks between the fields, or what a first line ``sep=;`` says;
    lines that start with ``#`` or ``%`` are remarks, the last of which may be the header; a
    preamble is passed over, and a row of units below the header goes with the names. A decimal
    comma is understood where the separator is another one, and in quotes, in a table whose other
    numbers have no decimal point. Without a header the columns are named "1", "2" and so on. A
    column with text in it, as with commas that are no decimal ones, stays text.

    Raises
    ------
    InputError
        For a file that is empty, not text, has a header but no rows, or a row with more or fewer
        fields than the others (by its line number).
    """
    lines: Lines = []
    remarks: dict[int, str] = {}
    declared = ""
    for number, line in enumerate(_text(path).splitlines(), start=1):
        text = line.strip()
        if number == 1 and (found := _DECLARED.fullmatch(text)):
            declared = found["separator"]
        elif text.startswith(("#", "%")):
            remarks[len(lines)] = text.lstrip("#% \t")
        elif text:
            lines.append((number, line))
    if not lines:
        raise InputError(f"{path}: the file is empty")
    separator = declared or _separator([line for _, line in lines])
    layout = find_layout(
        lambda row: _fields(lines[row][1], separator),
        len(lines),
        {row: _fields(text, separator) for row, text in remarks.items()},
        str(path),
    )
    lines = lines[layout.first :]
    texts = [line for _, line in lines]
    if separator != "," and any("," in line for line in texts):
        rows = (_fields(line, separator) for line in texts)
        if _comma_is_decimal(rows, any("." in line for line in texts)):
            texts = [line.replace(",", ".") for line in texts]
    names = layout.names
    return _numbers(texts, separator, names) or _mixed(path, lines, separator, names)


def _text(path: Path) -> str:
    try:
        with opened(path) as file:
            content = file.read(MOST_TEXT + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be unpacked or read ({error})") from None
    if len(content) > MOST_TEXT:
        raise InputError(
            f"{path}: more than {MOST_TEXT // 1_000_000} MB of text; cut the recording, or save it "
            "as NPZ or HDF5"
        )
    text = _decoded(content)
    if "\0" in text:
        raise InputError(f"{path}: not a text file; its name should end as its format does")
    return text


def _decoded(content: bytes) -> str:
    """By the mark at its beginning, by where its zeros are, as UTF-8, or as Latin-1."""
    for mark, encoding in (
        (codecs.BOM_UTF16_LE, "utf-16"),
        (codecs.BOM_UTF16_BE, "utf-16"),
        (codecs.BOM_UTF8, "utf-8-sig"),
    ):
        if content.startswith(mark):
            return content.decode(encoding, "replace")
    # Latin letters in UTF-16 are every second byte.
    if content[1:64:2].count(0) > 24:
        return content.decode("utf-16-le", "replace")
    if content[:64:2].count(0) > 24:
        return content.decode("utf-16-be", "replace")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _separator(lines: list[str]) -> str | None:
    """The separator that most of the rows have; None stands for any run of blanks."""
    sample = lines[len(lines) // 2 :][:50]
    for separator in ("\t", ";", "|", ","):
        if 2 * sum(separator in line for line in sample) > len(sample):
            # Numbers with decimal commas and blanks between them are no table of commas.
            blanks = separator == "," and 2 * sum(map(_is_of_blanks, sample)) > len(sample)
            return None if blanks else separator
    return None


def _is_of_blanks(line: str) -> bool:
    fields = line.split()
    return len(fields) > 1 and all(map(NUMBER.fullmatch, fields))


def _fields(line: str, separator: str | None) -> list[str]:
    if separator is None:
        return [field.strip('"') for field in line.split()]
    try:
        rows = list(csv.reader(io.StringIO(line), delimiter=separator, skipinitialspace=True))
    except csv.Error:
        rows = [line.split(separator)]
    return [field.strip() for field in (rows[0] if rows else [])]


def _numbers(lines: list[str], separator: str | None, names: list[str]) -> Arrays | None:
    """The fast way, for tables of nothing but numbers."""
    try:
        table = np.loadtxt(lines, delimiter=separator, ndmin=2, quotechar='"', comments=None)
    except ValueError:
        return None
    if table.shape[1] != len(names):
        return None
    return dict(zip(names, np.ascontiguousarray(table.T), strict=True))


def _mixed(path: Path, lines: Lines, separator: str | None, names: list[str]) -> Arrays:
    """The slow way, column by column; tells which line does not fit."""
    rows: list[list[str]] = []
    for number, line in lines:
        fields = _fields(line, separator)
        # Many programs end every row with a separator.
        if len(fields) == len(names) + 1 and fields[-1] == "":
            fields = fields[:-1]
        if len(fields) != len(names):
            last = number == lines[-1][0] and len(rows) > 1
            why = (
                "it is the last one, where the file was cut off: remove it"
                if last
                else ("is the file cut off, or the separator another one?")
            )
            raise InputError(
                f"{path}: line {number} has {_counted(fields)} where {len(names)} are expected "
                f"({', '.join(names)}); {why}"
            )
        rows.append(fields)
    return typed_columns(names, rows)


def _counted(fields: list[str]) -> str:
    return f"{len(fields)} field{'s' if len(fields) != 1 else ''}"


def typed_columns(names: list[str], rows: list[list[str]]) -> Arrays:
    """Columns of text as numbers where all of a column are, with a decimal point or comma.

    What is left empty among numbers is NaN, and clock times are seconds. A unit behind each number
    of a column, as in MATLAB's durations (0.001 sec), goes with the name.
    """
    columns: Arrays = {}
    commas = _comma_is_decimal(rows, any("." in field for row in rows for field in row))
    for name, column in zip(names, zip(*rows, strict=True), strict=True):
        text = np.array(column)
        missing = np.isin(np.char.lower(text), _MISSING)
        numbers = _numbers_of(text[~missing], commas)
        if numbers is None and (unit := _unit_of_each(text[~missing])):
            bare = np.array([_WITH_UNIT.sub(r"\g<number>", one) for one in text[~missing]])
            numbers, name = _numbers_of(bare, commas), f"{name} ({unit})"
        if numbers is None:
            columns[name] = text
        else:
            columns[name] = np.full(len(text), np.nan)
            columns[name][~missing] = numbers
    return columns


def _comma_is_decimal(rows: Iterable[Sequence[str]], points: bool) -> bool:
    """Whether the commas in the numbers of a table are decimal ones, and part no thousands.

    They are none beside a decimal point. In a table without one, numbers that no thousands explain
    (0,181 or 1,5) show decimal ones; where all could be either, a column in which every number from
    1000 on, and no other, has a comma shows thousands.

    Parameters
    ----------
    rows : iterable of sequence of str
        The fields of each row.
    points : bool
        Whether there is a point anywhere, in a date or a number.
    """
    shown = False
    parted: set[int] = set()
    small: set[int] = set()
    large: set[int] = set()
    for row in rows:
        for column, field in enumerate(row):
            if "." in field and (_POINT.fullmatch(field) or THOUSANDS.fullmatch(field)):
                return False
            if "," not in field:
                if field.lstrip("+-").isdecimal():
                    (small if len(field.lstrip("+-")) < 4 else large).add(column)
            elif THOUSANDS.fullmatch(field):
                if field.count(",") > 1:
                    return False
                parted.add(column)
            elif NUMBER.fullmatch(field):
                shown = True
        if shown and not points:
            return True
    return shown or not (parted & small) - large


def _numbers_of(text: NDArray[np.str_], commas: bool) -> Floats | None:
    """Numbers, or clock times; None where there is anything else, or nothing."""
    if len(text) == 0:
        return None
    for written in (text, np.char.replace(text, ",", ".")) if commas else (text,):
        with contextlib.suppress(ValueError):
            return written.astype(float)
    return _seconds(text)


def _unit_of_each(text: NDArray[np.str_]) -> str | None:
    """The unit that stands behind every number, where it is one and the same."""
    found = list(map(_WITH_UNIT.fullmatch, text))
    units = {one["unit"] if one else "" for one in found}
    return next(iter(units)) if len(units) == 1 and all(map(is_unit, units)) else None


def _seconds(text: NDArray[np.str_]) -> Floats | None:
    """Times of the day, with any date before them, in seconds since the first one's midnight."""
    found = [one for one in map(_CLOCK.fullmatch, text) if one]
    if len(found) < len(text):
        return None
    parts = [[part.replace(",", ".") for part in one.groups("0")] for one in found]
    clock = np.array(parts, dtype=float) @ [3600.0, 60.0, 1.0, 60.0, 1.0]
    # Twelve hours and twenty-four begin anew, and so does the one where none is shown; a recording
    # takes less than half of it.
    return np.unwrap(clock, period=12 * 3600.0 if found[0][1] else 3600.0)


_SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".txt", ".txt.gz", ".dat", ".asc", ".lvm")
READER = Reader("CSV", _SUFFIXES, read_delimited)
