"""A measurement with what forces took off it put back, or once more without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayeshaptic.diagnosis.state import Change
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import RandomSpectra


def with_forces(etfe: Etfe, changes: Sequence[Change], sign: float = 1.0) -> Etfe:
    """The measurement with what forces took off put back; with a sign of -1 once more without."""
    own, spectra = etfe.recording, etfe.spectra
    assert own is not None and isinstance(spectra, RandomSpectra)
    for change in changes:
        own = replace(
            own,
            force=own.force + sign * change.command,
            position=own.position + sign * change.motion,
        )
        spectra = replace(
            spectra,
            force=spectra.force + sign * change.force,
            position=spectra.position + sign * change.position,
        )
    return replace(etfe, spectra=spectra, recording=own)
