"""A population of users: hands differ from person to person, the device hardly."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Population:
    """Posterior of a population of hands.

    Attributes
    ----------
    parameters : tuple of str
        Names of the hand's parameters, H of them.
    log_mean, log_sd : ndarray, shape (n, H)
        Of the logarithms over people.
    correlation : ndarray, shape (n, H, H)
    users : tuple of str
    """

    parameters: tuple[str, ...]
    log_mean: Floats = field(repr=False)
    log_sd: Floats = field(repr=False)
    correlation: Floats = field(repr=False)
    users: tuple[str, ...]
