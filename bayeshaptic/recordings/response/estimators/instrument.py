r"""Spectra of a recording with feedback, read through the reference that its controller followed.

In a closed loop the force U answers to the noise V of the position, Y = G U + leakage + V, and a
regression of Y on U finds a mixture of the device and the controller.  What the reference R does to
both is free of that: V has nothing to do with R.  In each window

.. math:: z = Q^H (Y - G U), \qquad s_0 = |(I - Q Q^H)(Y - G U)|^2,

Q an orthonormal basis of R times a parabola and a first fit (leakage projected out of all), hold
noise alone where G is right, of the same variance, whatever controller, hand and their spectra are:
the ratio of T. W. Anderson and H. Rubin, *Annals of Mathematical Statistics* 20(1), 1949, with R as
instrument (of responses in feedback: R. Pintelon and J. Schoukens, "System Identification: A
Frequency Domain Approach", 2nd ed., Wiley, 2012, chapter 2).  Where R is U, in open loop, this is
the likelihood of `RandomSpectra`.

The noise in U itself must not count as excitation: from U goes what the rest of the window explains
of it by Y - G U at the first fit (a control function; its fixed point is limited-information
maximum likelihood), and a window is left out where the reference hardly moves the force.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.local_polynomial import LEAKAGE_TERMS, project_out
from bayeshaptic.recordings.response.regressors import Block, regressors
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.recordings.response.windows import Reference, Windows

# F of the force's regression on the reference in a window, from which on what noise in the force
# does to the estimate is below a tenth (D. Staiger and J. H. Stock, Econometrica 65(3), 1997).
STRONG = 10.0
# Of the sampling rate: above, a command that is held moves next to nothing.
HIGHEST_THROUGH_REFERENCE = 0.4
_COLUMNS = 3  # of the instrument in a window: a parabola


@dataclass(frozen=True, eq=False)
class InstrumentSpectra(RandomSpectra):
    """DFT lines of force and position, and of the reference behind them.

    Attributes
    ----------
    instrument : complex ndarray, shape (L,)
        DFT of the reference, in any unit, or of what the command would have been had nothing moved.
    """

    instrument: NDArray[Any] = field(default_factory=lambda: np.zeros(0), repr=False)

    @cached_property
    def strength(self) -> NDArray[Any]:
        """F of the force's regression on the reference in each window, shape (W,)."""
        found = np.empty(len(self.nodes_hz))
        for block in self.blocks:
            basis = self._basis(block, block.weights, ())
            force = project_out(block.leakage, block.force[..., None])
            rest = _power(project_out(basis, force))
            explained = _power(force) - rest
            freedom = self._freedom(block) - _COLUMNS
            found[block.window] = explained / _COLUMNS / (rest / freedom + np.finfo(float).tiny)
        return found

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of the likelihood in which the reference moves the force.

        Parameters
        ----------
        reference : callable, optional
            A first fit; without, what noise in the force does is judged at the response that the
            window itself shows.
        inputs : complex ndarray, shape (J, L), optional
            As in `RandomSpectra.windows`; taken to owe nothing to the noise.
        """
        given = reference is not None
        reference = reference or self.reference
        columns = regressors(self.frequency_hz, self.nodes_hz, reference, inputs)
        count, k = len(self.nodes_hz), columns.count
        design = np.empty((count, k, k), dtype=complex)
        target = np.empty((count, k), dtype=complex)
        scatter = np.empty(count)
        for block in self.blocks:
            response, known = columns.response(block), columns.known(block)
            moved = [block.force[..., None] * response, *known]
            column = project_out(block.leakage, np.concatenate(moved, axis=-1))
            basis = self._basis(block, response, known)
            seen, answer = _onto(basis, column), _onto(basis, block.position[..., None])
            value = np.linalg.pinv(seen, rcond=1e-10) @ answer
            if given:
                value = np.concatenate(
                    [columns.at_nodes[block.window], np.zeros((len(value), len(known)))], 1
                )[..., None]
            error = block.position[..., None] - column @ value
            kept = _onto(basis, error)
            rest, aside = error - basis @ kept, column - basis @ seen
            size = _power(rest)
            noisy = np.swapaxes(rest.conj(), -1, -2) @ aside / size[:, None, None]
            clean = seen - kept @ noisy
            q, design[block.window] = np.linalg.qr(clean)
            target[block.window] = _onto(q, kept + clean @ value)[..., 0]
            scatter[block.window] = size
        lines = (np.diff(self.edges) - LEAKAGE_TERMS).astype(float)
        every = Windows(self.nodes_hz, design, target, scatter + lines * self.floor, lines)
        return every.part(self.strength > STRONG)

    def regressed(self) -> RandomSpectra:
        """The same lines without the reference: every window, and biased."""
        return RandomSpectra(
            self.frequency_hz, self.force, self.position, self.edges, self.floor, self.reference
        )

    def _basis(self, block: Block, response: NDArray[Any], known: Any) -> NDArray[Any]:
        """Q: orthonormal, (W, w, 3 + J); of the reference times three columns (W, w, 3)."""
        moved = (self.instrument[block.line] * block.whitened)[..., None] * response
        both = np.concatenate([moved, *known], axis=-1)
        return np.linalg.qr(project_out(block.leakage, both))[0]

    def _freedom(self, block: Block) -> NDArray[Any]:
        return np.diff(self.edges)[block.window] - LEAKAGE_TERMS


def _onto(basis: NDArray[Any], columns: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(np.swapaxes(basis.conj(), -1, -2) @ columns)


def _power(columns: NDArray[Any]) -> NDArray[Any]:
    return np.asarray(np.sum(np.abs(columns) ** 2, axis=(1, 2)))
