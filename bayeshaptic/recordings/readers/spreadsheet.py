"""Spreadsheets (xlsx), through openpyxl."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.readers.delimited import typed_columns
from bayeshaptic.recordings.readers.layout import find_layout
from bayeshaptic.recordings.readers.reader import MOST_COLUMNS, MOST_TEXT, Arrays, Reader

MOST_ROWS = 1_048_576  # what a sheet can have


def read_spreadsheet(path: Path) -> Arrays:
    """The columns of a spreadsheet's first sheet that has a table of numbers.

    Preamble, header and row of units are those of a text file. Of formulas there is the value that
    was saved with them.

    Raises
    ------
    InputError
        For a file that is not xlsx, has no table of numbers, or where openpyxl is missing.
    """
    try:
        from openpyxl import load_workbook
    except ImportError:
        raise InputError(
            f"{path}: spreadsheets need the formats extra: pip install 'bayeshaptic[formats]'; or "
            "save the sheet as CSV"
        ) from None
    problem = InputError(f"{path}: no table of numbers in this spreadsheet")
    # openpyxl meets damaged files with whatever exception its parsers run into.
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(part.file_size for part in archive.infolist()) > 5 * MOST_TEXT:
                raise InputError(f"{path}: too large to be read; cut it, or save it as CSV")
        book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
        for sheet in book.worksheets:
            try:
                return _columns([_row(cells) for cells in _cells(sheet)], f"{path}, {sheet.title}")
            except InputError as error:
                problem = error
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"{path}: not a readable spreadsheet ({type(error).__name__}: {error})"
        ) from None
    raise problem


def _cells(sheet: Any) -> Any:
    return sheet.iter_rows(max_row=MOST_ROWS, max_col=MOST_COLUMNS, values_only=True)


def _row(cells: tuple[Any, ...]) -> list[str]:
    return ["" if cell is None else str(cell).strip() for cell in cells]


def _columns(rows: list[list[str]], where: str) -> Arrays:
    rows = [row for row in rows if any(row)]
    width = max((i + 1 for row in rows for i, cell in enumerate(row) if cell), default=0)
    if not width:
        raise InputError(f"{where}: the sheet is empty")
    rows = [(row + [""] * width)[:width] for row in rows]
    # Rows of a preamble fill few of the columns.
    layout = find_layout(lambda i: rows[i], len(rows), {}, where)
    return typed_columns(layout.names, rows[layout.first :])


READER = Reader("spreadsheet", (".xlsx", ".xlsm"), read_spreadsheet, apart=True)
