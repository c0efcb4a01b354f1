"""What tables are made of: text that needs no further formatting, and the unit of a row."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.quantities import NOTHING, Scale, scale

Rows = tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class ParameterRow:
    """One parameter: all numbers in the unit of the row.

    `reference` is the device file's value, a dash without one; `shrinkage` the posterior's width as
    a share of the prior's.
    """

    name: str
    title: str
    unit: str
    least_squares: str
    posterior: str
    range: str
    reference: str
    ess: str
    rhat: str
    remarks: str
    shrinkage: str = NOTHING


def scale_of(draws: NDArray[Any], unit: str) -> Scale:
    """The unit in which a parameter is written, in tables and figures alike.

    By the upper end of its 90 % interval, too: the median of what may be zero is next to nothing.
    """
    return scale((float(value) for value in np.quantile(draws, (0.5, 0.95))), unit)
