"""What a recording with samples filled in is worth."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

from numpy.typing import NDArray

from bayeshaptic.recordings.response.etfe import Etfe, RandomSpectra
from bayeshaptic.recordings.response.windows import Reference, Windows


@dataclass(frozen=True)
class FilledSpectra(RandomSpectra):
    """Spectra of a record of which only a share was measured.

    What was filled in has no noise and no news: with a share p measured, the scatter is p times
    what the noise leaves, and p times the lines hold information. In the likelihood, where the
    information of a window is lines over scatter, both together are a scatter 1/p^2 times larger.

    Attributes
    ----------
    measured : float
        p, above 0 and at most 1.
    """

    measured: float = 1.0

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of the likelihood."""
        windows = super().windows(reference, inputs)
        return replace(windows, scatter=windows.scatter / self.measured**2)


def discounted(etfe: Etfe, measured: float) -> Etfe:
    """The estimate with the variance that it has where a share of the samples was filled in."""
    spectra = etfe.spectra
    if not isinstance(spectra, RandomSpectra) or measured >= 1:
        return etfe
    same = {field.name: getattr(spectra, field.name) for field in fields(RandomSpectra)}
    return replace(
        etfe,
        spectra=FilledSpectra(**same, measured=measured),
        variance=etfe.variance / measured**2,
    )
