"""The spectra behind an ETFE: from each kind the windows of the likelihood can be rebuilt."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.local_polynomial import (
    LEAKAGE_TERMS,
    NODES,
    interpolation,
    leakage_terms,
    project_out,
)
from bayeshaptic.recordings.response.regressors import Block, regressors
from bayeshaptic.recordings.response.windows import Reference, Windows

# Least relative error of a line: no device repeats itself better, and windows and models promise no
# better. Simulated recordings with an encoder reach 7e-5 in their best window; a smaller error
# counts as this one.
REPEATS_TO = 1e-5


class Spectra(Protocol):
    """What every kind of spectra offers."""

    @property
    def lines(self) -> int:
        """Number of DFT lines, or rows of a table."""

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of the likelihood."""


@dataclass(frozen=True, eq=False)
class RandomSpectra:
    """DFT lines of a recording with random excitation, and where its windows begin and end.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
        Consecutive lines of the DFT of the whole record, without a taper.
    force, position : complex ndarray, shape (L,)
        DFT over sqrt(N), so that white noise has the variance of a sample in each line.
    edges : ndarray of int, shape (W + 1,)
        Window w holds the lines edges[w]:edges[w + 1].
    floor : ndarray, shape (W,)
        Variance of a line's noise at least, whatever the lines of the window say.
    reference : callable
        The reference to use when none is given.
    noise_slope : ndarray, shape (W,), or None
        The power with which the noise falls over the frequency in each window; None: zero.
    ringing_hz : complex ndarray, shape (W,), or None
        The pole f + j a / 2 pi of a mode at f, its decay a, whose leakage a window shows; nan in
        the others, and None where it is in all of them (`estimators/ringing.py`).
    louder : ndarray, shape (W,), or None
        That of its `Windows`.
    """

    frequency_hz: NDArray[Any] = field(repr=False)
    force: NDArray[Any] = field(repr=False)
    position: NDArray[Any] = field(repr=False)
    edges: NDArray[Any] = field(repr=False)
    floor: NDArray[Any]
    reference: Reference = field(repr=False)
    noise_slope: NDArray[Any] | None = field(default=None, repr=False)
    ringing_hz: NDArray[Any] | None = field(default=None, repr=False)
    louder: NDArray[Any] | None = field(default=None, repr=False)

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    @cached_property
    def force_power(self) -> NDArray[Any]:
        """Mean power of the force in each window, shape (W,)."""
        return np.add.reduceat(np.abs(self.force) ** 2, self.edges[:-1]) / np.diff(self.edges)

    @property
    def nodes(self) -> NDArray[Any]:
        """Places in a window, from -1 to 1, where a model is evaluated, shape (k,)."""
        return NODES

    @cached_property
    def nodes_hz(self) -> NDArray[Any]:
        """Frequencies of the nodes, shape (W, k)."""
        low = self.frequency_hz[self.edges[:-1], None]
        high = self.frequency_hz[self.edges[1:] - 1, None]
        return (low + high) / 2 + (high - low) / 2 * self.nodes

    @property
    def middle_hz(self) -> NDArray[Any]:
        """The middle of each window, shape (W,)."""
        return np.asarray(self.nodes_hz[:, self.nodes_hz.shape[1] // 2])

    @cached_property
    def blocks(self) -> list[Block]:
        """All windows, those of similar width together."""
        # Padding costs less than a call a window: a block spans widths up to a factor 1.5.
        width = np.maximum.accumulate(np.diff(self.edges))
        blocks, first = [], 0
        while first < len(width):
            last = int(np.searchsorted(width, 1.5 * width[first], side="right"))
            blocks.append(self._block(slice(first, last)))
            first = last
        return blocks

    def _block(self, window: slice) -> Block:
        line, inside, x, frequency = self._lines(window)
        whitened = inside.astype(float)
        if self.noise_slope is not None:
            middle = self.middle_hz[window, None]
            whitened *= (frequency / middle) ** (self.noise_slope[window, None] / 2)
        terms = self._leakage(window, x, frequency)
        leakage = np.linalg.qr(terms * whitened[..., None])[0] * np.any(terms, -2, keepdims=True)
        position = self.position[line] * whitened
        return Block(
            window=window,
            line=line,
            whitened=whitened,
            force=self.force[line] * whitened,
            position=project_out(leakage, position[..., None])[..., 0],
            leakage=leakage,
            weights=interpolation(x, self.nodes),
        )

    def _lines(self, window: slice) -> tuple[NDArray[Any], ...]:
        """Of windows side by side, (W, w) each: which lines, and that they are no padding.

        And where in their window, from -1 to 1, and at what frequency; padding repeats the last.
        """
        start, width = self.edges[:-1][window, None], np.diff(self.edges)[window, None]
        offset = np.arange(width.max())
        line = start + np.minimum(offset, width - 1)
        x = 2 * (line - start) / (width - 1) - 1
        return line, offset < width, x, self.frequency_hz[line]

    def _leakage(self, window: slice, x: NDArray[Any], frequency: NDArray[Any]) -> NDArray[Any]:
        """What leakage may be, (W, w, 5), or 6 with zeros where nothing rings."""
        terms = leakage_terms(x, frequency, frequency.mean(axis=1, keepdims=True))
        if self.ringing_hz is None:
            return terms
        pole = self.ringing_hz[window, None]
        ringing = 1 / (frequency - np.where(np.isnan(pole), np.inf, pole))
        return np.concatenate([terms, ringing[..., None]], axis=-1)

    @cached_property
    def freedom(self) -> NDArray[Any]:
        """Lines of each window less what leakage takes; a pole that was looked for is one more."""
        lines = np.diff(self.edges) - float(LEAKAGE_TERMS)
        return lines if self.ringing_hz is None else lines - 2.0 * ~np.isnan(self.ringing_hz)

    def span_hz(self, windows: NDArray[Any]) -> tuple[float, float]:
        """The lowest and the highest line of `windows`, numbers in ascending order."""
        first, last = self.edges[windows[0]], self.edges[windows[-1] + 1] - 1
        return float(self.frequency_hz[first]), float(self.frequency_hz[last])

    def lowest(self, count: int) -> RandomSpectra:
        """Its lowest windows alone."""
        lines = slice(self.edges[count])

        return RandomSpectra(
            self.frequency_hz[lines],
            self.force[lines],
            self.position[lines],
            self.edges[: count + 1],
            self.floor[:count],
            self.reference,
            None if self.noise_slope is None else self.noise_slope[:count],
            None if self.ringing_hz is None else self.ringing_hz[:count],
            None if self.louder is None else self.louder[:count],
        )

    def free(
        self, window: slice, response: bool
    ) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
        """Windows side by side: lines (W, w), which are no padding, and leakage, (W, w, 5 or 6).

        With `response` also what a window's own response may make, (W, w, 8 or 9).
        """
        line, inside, x, frequency = self._lines(window)
        columns = self._leakage(window, x, frequency)
        if response:
            nodes = self.nodes_hz[window]
            at_nodes = np.asarray(self.reference(nodes.ravel())).reshape(nodes.shape)
            at_lines = np.asarray(self.reference(frequency.ravel())).reshape(frequency.shape)
            ratio = at_lines[..., None] / at_nodes[:, None]
            answer = self.force[line][..., None] * interpolation(x, self.nodes) * ratio
            columns = np.concatenate([columns, answer], axis=-1)
        return line, inside, columns * inside[..., None]

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """The windows of the likelihood.

        The ratio of the response to the reference is a parabola in each window, through its
        values at three Chebyshev nodes; what leakage may be is projected out.

        Parameters
        ----------
        reference : callable, optional
        inputs : complex ndarray, shape (J, L), optional
            Further columns at the lines: motions that add to the position with a coefficient each.

        Returns
        -------
        Windows
            With k = 3 nodes a window, and J more columns; where that is more than a window has
            lines, rows of zeros.
        """
        reference = reference or self.reference
        columns = regressors(self.frequency_hz, self.nodes_hz, reference, inputs)
        count, k = len(self.nodes_hz), columns.count
        design = np.zeros((count, k, k), dtype=complex)
        target = np.zeros((count, k), dtype=complex)
        scatter = np.empty(count)
        for block in self.blocks:
            # The position goes along as a last column: what is left of it is the last number.
            moved = [block.force[..., None] * columns.response(block), *columns.known(block)]
            both = np.concatenate([*moved, block.position[..., None]], axis=-1)
            triangle = np.asarray(np.linalg.qr(project_out(block.leakage, both), mode="r"))
            rows = min(triangle.shape[1], k)
            design[block.window, :rows] = triangle[:, :rows, :k]
            target[block.window, :rows] = triangle[:, :rows, k]
            scatter[block.window] = np.sum(np.abs(triangle[:, k:, k]) ** 2, axis=1)
        return Windows(
            frequency_hz=self.nodes_hz,
            design=design,
            target=target,
            scatter=scatter + self.freedom * self.floor,
            lines=self.freedom,
            louder=self.louder,
        )


@dataclass(frozen=True, eq=False)
class PeriodicSpectra:
    """Excited lines of a periodic excitation.

    Attributes
    ----------
    frequency_hz : ndarray, shape (L,)
    force, position : complex ndarray, shape (L,)
        DFT over all kept periods, over the square root of the number of samples, leakage removed;
        scaled so that the noise of a position has the variance scatter / (freedom - 1).
    scatter : ndarray, shape (L,)
        Sum of the squares of the noise beside the line.
    freedom : ndarray, shape (L,)
        One more than the degrees of freedom of `scatter`.
    periods : int
        Number of kept periods.
    """

    frequency_hz: NDArray[Any] = field(repr=False)
    force: NDArray[Any] = field(repr=False)
    position: NDArray[Any] = field(repr=False)
    scatter: NDArray[Any] = field(repr=False)
    freedom: NDArray[Any] = field(repr=False)
    periods: int

    @property
    def lines(self) -> int:
        return len(self.frequency_hz)

    def windows(
        self, reference: Reference | None = None, inputs: NDArray[Any] | None = None
    ) -> Windows:
        """One window an excited line; the reference is not needed."""
        columns = [self.force] if inputs is None else [self.force, *inputs]
        return Windows(
            frequency_hz=self.frequency_hz[:, None],
            design=np.stack(columns, axis=-1)[:, None, :],
            target=self.position[:, None],
            scatter=self.scatter,
            lines=self.freedom,
        )
