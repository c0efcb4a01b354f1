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

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.windows import ALIKE, Reference, Windows

# Degrees of freedom of a line: those that the narrowest windows, of 24 lines, have for each.
_FREEDOM = 0.75
# Where leakage hides nothing the lowest lines tell the most, and a pole may lie between them: a
# parabola of their window is 8 % off there, this polynomial 0.3 %.
_MANY_NODES = np.cos(np.pi * (np.arange(7)[::-1] + 0.5) / 7)


@dataclass(frozen=True, eq=False)
class DirectSpectra(RandomSpectra):
    """All DFT lines of a recording, whose windows hold whatever loop it was made in.

    Attributes
    ----------
    rounding : float
        Variance of the noise that the encoder makes of a sample: before a model says what it
        leaves, no window has less.
    free_motions : complex ndarray, shape (S, L), or None
        Spectra of what the device does by itself, where leakage is nothing else (`free_motions`
        below); None: leakage may be anything that is smooth, in every window.
    """

    rounding: float = 0.0
    free_motions: NDArray[Any] | None = field(default=None, repr=False)

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
        plain = self._compressed(reference, inputs)
        freedom = (_FREEDOM if self.free_motions is None else 1.0) * np.diff(self.edges)
        # Before a model says more; common columns need one.
        plain = replace(plain, noise=np.maximum(plain.scatter / freedom, self.rounding))
        freedom = freedom - plain.common_freedom
        if reference is None:
            return replace(plain, lines=1.0 + freedom)
        nodes = plain.frequency_hz
        response = np.asarray(reference(nodes.ravel())).reshape(nodes.shape)
        fitted = plain.design[:, :, : nodes.shape[1]] @ response[..., None]
        left = plain.without_common((plain.target - fitted[..., 0])[None])[0]
        noise = (plain.scatter + np.sum(np.abs(left) ** 2, axis=1)) / freedom
        return replace(plain, lines=1.0 + freedom, noise=noise)

    def left(self, reference: Reference) -> NDArray[Any]:
        """What a response leaves of the position at all lines, free motions taken off, (L,)."""
        left = self.position - self.force * np.asarray(reference(self.frequency_hz))
        if self.free_motions is None:
            return left
        columns = self.free_motions.copy().view(float).T
        columns /= np.linalg.norm(columns, axis=0)
        best = np.linalg.lstsq(columns, left.view(float), rcond=ALIKE)[0]
        return np.asarray(left - (columns @ best).view(complex))

    def _compressed(self, reference: Reference | None, inputs: NDArray[Any] | None) -> Windows:
        """The windows of any random excitation, free motions apart from what else is an input."""
        free = self.free_motions
        if free is None:
            return super().windows(reference, inputs)
        both = free if inputs is None else np.concatenate([inputs, free])
        plain = super().windows(reference, both)
        own = plain.design.shape[2] - len(free)
        return replace(plain, design=plain.design[:, :, :own], common=plain.design[:, :, own:])

    @property
    def nodes(self) -> NDArray[Any]:
        """Three in a window, or seven beside free motions."""
        return super().nodes if self.free_motions is None else _MANY_NODES

    def _leakage(self, window: slice, x: NDArray[Any], frequency: NDArray[Any]) -> NDArray[Any]:
        """None beside that of the free motions."""
        if self.free_motions is None:
            return super()._leakage(window, x, frequency)
        return np.zeros((*x.shape, 1))


def free_motions(
    poles: NDArray[Any], delay_s: float, period_s: float, frequency_hz: NDArray[Any]
) -> NDArray[Any]:
    r"""Spectra of what a device does by itself in a record that does not end as it began.

    Parameters
    ----------
    poles : complex ndarray, shape (n,)
        Of the continuous device, rad/s, with their conjugates.
    delay_s, period_s : float
    frequency_hz : ndarray, shape (L,)
        Lines of the DFT.

    Returns
    -------
    complex ndarray, shape (S, L)
        Over a whole record z^N is one, so that a motion p^k has the spectrum
        :math:`(1 - p^N) / (1 - p z^{-1})`, whatever N; of a pair of poles the sum and j times the
        difference; what a constant force does to a device that nothing holds,
        :math:`(1 - z^{-1})^{-2}`; and the first samples, one by one, which answer to forces that
        came before the record. Coefficients are real.
    """
    back = np.exp(-2j * np.pi * frequency_hz * period_s)
    found = [(1 - back) ** -2]
    for pole in poles[poles.imag >= 0]:
        one, other = (1 / (1 - np.exp(p * period_s) * back) for p in (pole, np.conj(pole)))
        for power in (1, 2) if pole else (1,):
            sum_, difference = one**power + other**power, 1j * (one**power - other**power)
            found += [sum_] if pole.imag == 0 else [sum_, difference]
    return np.array(found + [back**k for k in range(int(delay_s / period_s) + 1)])
