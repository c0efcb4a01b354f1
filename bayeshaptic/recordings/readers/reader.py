"""What a reader of a file format is, and how much it may read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.errors import InputError

# A table with more columns than this is an image or a matrix, not signals side by side.
MOST_COLUMNS = 64
# Numbers in one array, and bytes of unpacked text: an hour of three signals at 4 kHz. What claims
# more is a mistake, or a file made to fill the memory.
MOST_NUMBERS = 50_000_000
MOST_TEXT = 200_000_000

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Reader:
    """A file format, by the ends of its file names.

    Attributes
    ----------
    title : str
        The format's name in messages.
    suffixes : tuple of str
        Ends of file names in lower case, for example ``(".csv", ".csv.gz")``.
    read : callable
        ``read(path)`` gives the file's 1-D arrays by name: numbers, or text where a column holds
        something that is not a number (it is refused only where it is asked for). A unit that the
        file gives stands in brackets after the name, ``"Position (mm)"``. It raises `InputError`
        for a file that it cannot read.
    apart : bool
        Whether it is to run in a process of its own, because the library behind it can crash on
        a damaged file.
    """

    title: str
    suffixes: tuple[str, ...]
    read: Callable[[Path], Arrays]
    apart: bool = False


def is_signal(shape: tuple[int, ...]) -> bool:
    """Whether an array of this shape holds signals: a vector, or few of them side by side."""
    sides = [side for side in shape if side != 1]
    return 0 not in shape and len(sides) <= 2 and (len(sides) < 2 or min(sides) <= MOST_COLUMNS)


def refuse_size(shape: tuple[int, ...], where: str) -> None:
    """Refuse an array before memory is taken for it.

    Raises
    ------
    InputError
        Where it has more than `MOST_NUMBERS`.
    """
    count = int(np.prod(shape, dtype=object))
    if count > MOST_NUMBERS:
        raise InputError(
            f"{where}: claims {count} numbers, more than the {MOST_NUMBERS} that are read; "
            "cut the recording, or mend the file"
        )


def vectors(name: str, values: NDArray[Any], separator: str = ".") -> Arrays:
    """A file's array as named vectors: (N, 1) and (1, N) flattened, a matrix column by column.

    The longer side of a matrix is taken to be time; its columns are named ``name.1``, ``name.2``
    and so on. What holds no real numbers, or has three dimensions, gives nothing.
    """
    if values.dtype.kind not in "iufb" or not is_signal(values.shape):
        return {}
    values = np.squeeze(values)
    if values.ndim <= 1:
        return {name: np.atleast_1d(values)}
    rows = values.T if values.shape[0] >= values.shape[1] else values
    return {f"{name}{separator}{i}": row for i, row in enumerate(rows, start=1)}
