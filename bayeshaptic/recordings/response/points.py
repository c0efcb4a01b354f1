"""What a person sees of a frequency response."""

from __future__ import annotations

from typing import Any, NamedTuple

from numpy.typing import NDArray


class Points(NamedTuple):
    """Estimates of the response, all of shape (L,).

    Attributes
    ----------
    frequency_hz : ndarray
    value : complex ndarray
    variance : ndarray
        E|value - truth|^2.
    coherence : ndarray
        0 to 1.
    """

    frequency_hz: NDArray[Any]
    value: NDArray[Any]
    variance: NDArray[Any]
    coherence: NDArray[Any]
