"""The spectra behind an ETFE: from each kind the windows of the likelihood can be rebuilt."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from numpy.typing import NDArray

from bayeshaptic.recordings.windows import Reference, Windows


class Spectra(Protocol):
    """What every kind of spectra offers."""

    @property
    def lines(self) -> int: ...

    def windows(self, reference: Reference | None = None) -> Windows: ...


@dataclass(frozen=True)
class RandomSpectra:
    """DFT lines of a recording with random excitation, and where its windows begin and end."""

    frequency_hz: NDArray[Any] = field(repr=False)
    force: NDArray[Any] = field(repr=False)
    position: NDArray[Any] = field(repr=False)
    starts: NDArray[Any] = field(repr=False)
    floor: float = 0.0

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    def windows(self, reference: Reference | None = None) -> Windows:
        raise NotImplementedError


@dataclass(frozen=True)
class PeriodicSpectra:
    """Excited lines of a periodic excitation."""

    frequency_hz: NDArray[Any] = field(repr=False)
    force: NDArray[Any] = field(repr=False)
    position: NDArray[Any] = field(repr=False)
    scatter: NDArray[Any] = field(repr=False)
    freedom: NDArray[Any] = field(repr=False)
    periods: int = 0

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    def windows(self, reference: Reference | None = None) -> Windows:
        raise NotImplementedError


@dataclass(frozen=True)
class TableSpectra:
    """Rows of a frequency-response table."""

    frequency_hz: NDArray[Any] = field(repr=False)
    value: NDArray[Any] = field(repr=False)
    variance: NDArray[Any] = field(repr=False)
    averages: NDArray[Any] = field(repr=False)

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    def windows(self, reference: Reference | None = None) -> Windows:
        raise NotImplementedError
