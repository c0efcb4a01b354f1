"""What several figures need of a posterior: a few draws, and the responses they give."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

DRAWS = 200
POINTS = 240


@dataclass(frozen=True)
class ResponseBand:
    """Pointwise 5, 50 and 95 per cent quantiles of the model's response, each of shape (L,)."""

    frequency_hz: NDArray[Any]
    gain_db: tuple[NDArray[Any], NDArray[Any], NDArray[Any]]
    phase_deg: tuple[NDArray[Any], NDArray[Any], NDArray[Any]]


def thinned(draws: NDArray[Any], count: int = DRAWS) -> NDArray[Any]:
    """About `count` draws, evenly spaced over `draws` of shape (n, P)."""
    return draws[:: max(len(draws) // count, 1)][:count]


def response_band(analysis: Analysis) -> ResponseBand:
    """The posterior's response on a fine grid over the band."""
    measured_hz = analysis.etfe.frequency_hz
    grid = np.geomspace(measured_hz[0], measured_hz[-1], POINTS)
    frequency_hz = np.unique(np.r_[grid, measured_hz])
    response = analysis.model.response(
        thinned(analysis.posterior.draws), frequency_hz, measured=True
    )
    return ResponseBand(
        frequency_hz,
        _quantiles(20 * np.log10(np.abs(response))),
        _quantiles(np.degrees(np.unwrap(np.angle(response), axis=1))),
    )


def _quantiles(values: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    low, middle, high = np.quantile(values, (0.05, 0.5, 0.95), axis=0)
    return low, middle, high
