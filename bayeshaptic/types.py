"""Names of types that every part of the package uses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int_]
Bools = NDArray[np.bool_]
Bytes = NDArray[np.uint8]

LogDensity = Callable[[Floats], Floats]
"""Log density of points, shape (B, D), up to a constant; shape (B,)."""
Progress = Callable[[float, str], None]
"""Called with the share of the work done, 0 to 1, and a word about it."""
Tick = Callable[[str], None]
"""Called with what is being tried."""
Work = Callable[[Any], Any]
"""A job: called with an item, in whatever process."""
Executor = Callable[[Work, Sequence[Any]], Iterator[Any]]
"""Runs a job on every item and yields an outcome (`item`, `result`, `error`) as each ends."""
