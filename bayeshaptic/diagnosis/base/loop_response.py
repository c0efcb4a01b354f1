"""The response of the loop, where something else than a command and a position was sensed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bayeshaptic.inference.fit import Fit
from bayeshaptic.models.response.between_samples import with_images
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe

_SAME = 0.1  # the chi-square that is no difference


def as_of_the_loop(etfe: Etfe, fit: Fit) -> Etfe:
    """The response as of a position sampled in the loop, whatever was sensed in its place.

    Parameters
    ----------
    etfe : Etfe
        As it was measured; back as it is where it is that of a position beside a command.
    fit : Fit
        Of it, or of what an earlier fit made of it.
    """
    if etfe.recording is None or etfe.recording.sensed is None:
        return etfe
    recording = with_images(etfe.recording, fit.model.system(fit.theta))
    return replace(estimate_etfe(recording, etfe.band_hz), notices=etfe.notices)


def hardly_differ(etfe: Etfe, other: Etfe) -> bool:
    """Whether two estimates from one measurement are the same, beside their errors."""
    apart = np.abs(etfe.value - other.value) ** 2 / etfe.variance
    return bool(np.sum(apart) < _SAME)
