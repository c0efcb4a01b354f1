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

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of all parts, one part after the other; without further inputs."""
        found = [part.windows(reference) for part in self.parts]
        return Windows(
            *(
                np.concatenate([getattr(windows, name) for windows in found])
                for name in ("frequency_hz", "design", "target", "scatter", "lines")
            )
        )
