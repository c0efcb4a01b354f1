"""The spectra of several pieces that count together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.spectra import Spectra
from bayeshaptic.recordings.response.windows import Reference, Windows


@dataclass(frozen=True, eq=False)
class JoinedSpectra:
    """Spectra of the pieces of a recording, each with its own noise.

    Attributes
    ----------
    parts : tuple of RandomSpectra, or of PeriodicSpectra
    """

    parts: tuple[Spectra, ...]

    @property
    def lines(self) -> int:
        return sum(part.lines for part in self.parts)

    @property
    def frequency_hz(self) -> NDArray[Any]:
        """Of the lines of all parts, one part after the other, shape (L,)."""
        return np.concatenate([part.frequency_hz for part in self.parts])  # type: ignore[attr-defined]

    @property
    def louder(self) -> None:
        """Nobody's hand moves the device further without a force: see `Windows`."""
        return None

    @property
    def own_lines(self) -> tuple[slice, ...]:
        """Which of the lines are those of each part."""
        edges = np.cumsum([0, *(part.lines for part in self.parts)]).tolist()
        return tuple(slice(a, b) for a, b in zip(edges[:-1], edges[1:], strict=True))

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of all parts, one part after the other; `inputs` at the lines of all."""
        found = [
            part.windows(reference, None if inputs is None else inputs[:, own])
            for part, own in zip(self.parts, self.own_lines, strict=True)
        ]
        return Windows(
            *(
                np.concatenate([getattr(windows, name) for windows in found])
                for name in ("frequency_hz", "design", "target", "scatter", "lines")
            )
        )
