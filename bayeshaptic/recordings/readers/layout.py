"""Where the table in a text file or spreadsheet begins, and what its columns are called.

Above the numbers there may be anything: who recorded it and when, a header, a row of units. The
table is known by its bulk: most rows have so many fields, and numbers in such columns.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import zip_longest

from bayeshaptic.errors import InputError
from bayeshaptic.recordings.units import is_unit

NUMBER = re.compile(r"[-+]?(\d+[.,]?\d*|[.,]\d+)([eE][-+]?\d+)?|[-+]?(nan|inf(inity)?)", re.I)

Fields = list[str]


@dataclass(frozen=True)
class TextLayout:
    """Where the numbers are.

    Attributes
    ----------
    names : list of str
        Of the columns; a unit stands in brackets after the name. "1", "2", ... without a header.
    first : int
        The first row of numbers.
    """

    names: list[str]
    first: int


def find_layout(
    fields_of: Callable[[int], Fields],
    rows: int,
    remarks: Mapping[int, Fields],
    where: str,
) -> TextLayout:
    """The layout of a table.

    Parameters
    ----------
    fields_of : callable
        The fields of a row by its index.
    rows : int
        How many rows there are, remarks left out.
    remarks : mapping of int to list of str
        The fields of the remark (a line after #) just before a row, by that row's index.
    where : str
        The file, for messages.

    Raises
    ------
    InputError
        Where there are no rows of numbers, or the header does not fit them, or has a name twice.
    """
    sampled_rows = 64
    sample = sorted({round(i * (rows - 1) / sampled_rows) for i in range(sampled_rows + 1)})
    bulk = [fields for fields in map(fields_of, sample) if any(map(_is_number, fields))]
    if not bulk:
        header = [name for name in fields_of(0) if name]
        raise InputError(f"{where}: a header ({', '.join(header)}) but no rows of numbers")
    width = Counter(map(len, bulk)).most_common(1)[0][0]
    of_width = [fields for fields in bulk if len(fields) == width]
    usual = Counter(sum(map(_is_number, fields)) for fields in of_width).most_common(1)[0][0]

    def holds_numbers(row: int) -> bool:
        return len(fields := fields_of(row)) == width and 2 * sum(map(_is_number, fields)) > usual

    def above_a_header(row: int) -> bool:
        near = 4  # rows, in which a preamble of as many fields as the table has comes to its end
        below = map(fields_of, range(row + 1, min(row + 1 + near, rows)))
        return any(
            len(one) == width and all(one) and not any(map(_is_number, one)) for one in below
        )

    top = next(filter(holds_numbers, range(rows)))
    below = (row for row in range(top, rows) if holds_numbers(row) and not above_a_header(row))
    first = next(below, top)  # the top where words stand below every row
    # Many programs end every row with a separator.
    closed = all(fields[-1] == "" for fields in of_width)
    names = _names(fields_of, first, width, closed, remarks, where)
    twice = [name for name, count in Counter(names).items() if count > 1 and name]
    if twice:
        raise InputError(f"{where}: the header has '{twice[0]}' more than once; rename one")
    return TextLayout([name or f"column {i}" for i, name in enumerate(names, start=1)], first)


def _names(
    fields_of: Callable[[int], Fields],
    first: int,
    width: int,
    closed: bool,
    remarks: Mapping[int, Fields],
    where: str,
) -> list[str]:
    widths = (width, width - 1) if closed else (width,)

    def header(row: int) -> Fields | None:
        fields = fields_of(row) if row >= 0 else []
        if len(fields) == width + 1 and fields[-1] == "Comment":  # LabVIEW's, which the rows lack
            fields = fields[:-1]
        return fields if len(fields) in widths and not any(map(_is_number, fields)) else None

    # Between header and numbers there may be a row of nothing but separators.
    last = next((row for row in reversed(range(first)) if any(fields_of(row))), -1)
    above = header(last)
    if above is not None:
        higher = header(last - 1)
        units = [field.strip("[]()- ") for field in above]
        if higher is not None and any(units) and all(not u or is_unit(u) for u in units):
            pairs = zip_longest(higher, units[:width], fillvalue="")
            above = [f"{name} ({unit})" if unit else name for name, unit in pairs]
        return above[: width - closed]
    remark = remarks.get(first, [])
    if len(remark) in widths and not any(map(_is_number, remark)):
        return remark[: width - closed]
    if first == 1 and len(fields_of(0)) > 1 and not any(map(_is_number, fields_of(0))):
        raise InputError(
            f"{where}: the header has {len(fields_of(0))} names ({', '.join(fields_of(0))}) where "
            f"the rows have {width} fields; is the separator another one?"
        )
    return [str(i) for i in range(1, width - closed + 1)]


def _is_number(field: str) -> bool:
    return NUMBER.fullmatch(field) is not None
