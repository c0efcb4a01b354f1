"""What a reader of a file format is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

# A table with more columns than this is an image or a matrix, not signals side by side.
MOST_COLUMNS = 64

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
        something that is not a number (it is refused only where it is asked for). It raises
        `InputError` for a file that it cannot read.
    """

    title: str
    suffixes: tuple[str, ...]
    read: Callable[[Path], Arrays]


def vectors(name: str, values: NDArray[Any], separator: str = ".") -> Arrays:
    """A file's array as named vectors: (N, 1) and (1, N) flattened, a matrix column by column.

    The longer side of a matrix is taken to be time; its columns are named ``name.1``, ``name.2``
    and so on. What holds no real numbers, or has three dimensions, gives nothing.
    """
    if values.dtype.kind not in "iufb" or values.size == 0:
        return {}
    values = np.squeeze(values)
    if values.ndim <= 1:
        return {name: np.atleast_1d(values)}
    if values.ndim > 2 or min(values.shape) > MOST_COLUMNS:
        return {}
    rows = values.T if values.shape[0] >= values.shape[1] else values
    return {f"{name}{separator}{i}": row for i, row in enumerate(rows, start=1)}


def nested(
    tree: Mapping[str, Any], expand: Callable[[Any], Any], separator: str = ".", prefix: str = ""
) -> Arrays:
    """The vectors of a tree of named arrays, inner names joined by `separator`.

    `expand` turns a node into a mapping (a branch), an array (a leaf) or None (nothing to read).
    """
    found: Arrays = {}
    for name, node in tree.items():
        content = expand(node)
        if isinstance(content, Mapping):
            found.update(nested(content, expand, separator, f"{prefix}{name}{separator}"))
        elif content is not None:
            found.update(vectors(f"{prefix}{name}", content, separator))
    return found
