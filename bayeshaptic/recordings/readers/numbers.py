"""What a file holds as numbers; what is none is refused where it is asked for."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError

# In the place of an array that cannot be numbers.
NO_NUMBERS = "no real numbers"
# What may be a number whose thousands are parted.
THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(,\d{3})+(\.\d*)?")
# The same where the comma is the decimal sign; without a comma it may be a decimal point.
_THOUSANDS_BY_POINTS = re.compile(r"[-+]?[1-9]\d{0,2}((\.\d{3})+,\d*|(\.\d{3}){2,})")


def as_numbers(values: NDArray[Any], where: str) -> NDArray[np.float64]:
    """The array in double precision.

    Raises
    ------
    InputError
        Where something in it is not a number: the first such row, counted from 1 after the header.
    """
    try:
        return np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        rows = [(i, v) for i, v in enumerate(values, start=1) if not _is_number(v)]
        row, text = rows[0]
    if not THOUSANDS.fullmatch(str(text)):
        # Of a column with decimal commas what is no number with them either is what keeps it text.
        odd = (one for one in rows if not _is_number(str(one[1]).replace(",", ".")))
        row, text = next(odd, rows[0])
    if text == NO_NUMBERS:
        raise InputError(f"{where} is there, but holds {text}; save it as such")
    what = f"'{text}' is not a number" if str(text).strip() else "there is no number"
    cure = "write all with one decimal sign" if "," in str(text) else "mend or remove the row"
    if THOUSANDS.fullmatch(str(text)) or _THOUSANDS_BY_POINTS.fullmatch(str(text)):
        what, cure = f"thousands separators ('{text}')", "write the numbers without them"
    raise InputError(f"{where}: {what} in row {row}; {cure}", topic="rows")


def _is_number(value: object) -> bool:
    try:
        float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return False
    return True
