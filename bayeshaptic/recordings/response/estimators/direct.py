r"""Spectra of a recording with feedback of which nothing else is known: the direct method.

In a closed loop the noise V of the position comes back through the controller, and the response of
a window alone is a mixture of the device and the controller.  A model of the whole response is free
of that all the same.  With U = U_r - C S V the score of a change dG of the response has the mean

.. math:: \sum_k \mathrm{Re}\, dG^* \, E[U^* V] / \Phi_V = - \sum_k \mathrm{Re}\,(dG\, C S)

over all lines k, and that is the first value of an impulse response which begins a sample later: a
device answers after the command, and a controller after the motion.  It is zero, whatever the
controller is and whatever spectrum the noise has (the direct method: L. Ljung, "System
Identification", 2nd ed., Prentice Hall, 1999, chapter 13; that the noise's spectrum adds nothing is
Jensen's formula).  What it takes is that every line up to the Nyquist frequency counts the same,
none left out: of windows that lose a part of their lines to leakage the others count no more.

Nor is what a window's own response leaves its noise: the controller explains the rest.  Its noise
is what the model leaves, so that a fit weighs its windows anew as it goes on.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.windows import Reference, Windows

# Degrees of freedom of a line: those that the narrowest windows, of 24 lines, have for each.
_FREEDOM = 0.75


@dataclass(frozen=True, eq=False)
class DirectSpectra(RandomSpectra):
    """All DFT lines of a recording, whose windows hold whatever loop it was made in.

    Attributes
    ----------
    rounding : float
        Variance of the noise that the encoder makes of a sample: before a model says what it
        leaves, no window has less.
    """

    rounding: float = 0.0

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of the likelihood, with the noise that the reference leaves in each.

        Parameters
        ----------
        reference : callable, optional
            A first fit; without, the noise is what the window's own response leaves.
        inputs : complex ndarray, shape (J, L), optional
            As in `RandomSpectra.windows`.
        """
        plain = super().windows(reference, inputs)
        freedom = _FREEDOM * np.diff(self.edges)
        if reference is None:
            noise = np.maximum(plain.scatter / freedom, self.rounding)
        else:
            nodes = plain.frequency_hz
            response = np.asarray(reference(nodes.ravel())).reshape(nodes.shape)
            fitted = plain.design[:, :, : nodes.shape[1]] @ response[..., None]
            left = np.sum(np.abs(plain.target - fitted[..., 0]) ** 2, axis=1)
            noise = (plain.scatter + left) / freedom
        return replace(plain, lines=1.0 + freedom, noise=noise)
