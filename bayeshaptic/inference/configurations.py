"""Configurations of a device: its parameters along a coordinate."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Configurations:
    """K_CR along a configuration coordinate.

    Attributes
    ----------
    held : bool
    coordinates : ndarray, shape (C,)
        Where K_CR is predicted, the measured ones among them.
    measured : tuple of float
    """

    held: bool
    coordinates: Floats = field(repr=False)
    measured: tuple[float, ...]
