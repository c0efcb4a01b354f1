"""The limit along a configuration coordinate, as quantiles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.types import Floats

if TYPE_CHECKING:
    from bayeshaptic.study.configuration_limits import ConfigurationLimits


@dataclass(frozen=True)
class Band:
    """K_CR along a coordinate; arrays of shape (C,).

    Attributes
    ----------
    coordinates : ndarray
    low, middle, high : ndarray
        5, 50 and 95 per cent quantiles.
    """

    coordinates: Floats = field(repr=False)
    low: Floats = field(repr=False)
    middle: Floats = field(repr=False)
    high: Floats = field(repr=False)

    def rows(self) -> Iterator[tuple[float, tuple[float, float, float]]]:
        """Each coordinate with its quantiles."""
        for place, low, middle, high in zip(
            self.coordinates, self.low, self.middle, self.high, strict=True
        ):
            yield float(place), (float(low), float(middle), float(high))


def band_of(one: ConfigurationLimits) -> Band:
    """The band of one set of configurations."""
    return Band(np.asarray(one.coordinates, float), *one.quantile([0.05, 0.5, 0.95]))
