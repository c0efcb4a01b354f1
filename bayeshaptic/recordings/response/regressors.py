"""What the position is regressed on in each window: force times a parabola, and further inputs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.response.windows import Reference


class Block(NamedTuple):
    """Windows of similar width side by side, padded with lines that weigh nothing."""

    window: slice | NDArray[Any]
    line: NDArray[Any]  # (W, w) which line; padding repeats the last
    whitened: NDArray[Any]  # (W, w) weight of a line by its noise; zero in the padding
    force: NDArray[Any]  # (W, w) whitened, as are the next two
    position: NDArray[Any]  # (W, w) leakage projected out
    leakage: NDArray[Any]  # (W, w, 5) orthonormal
    weights: NDArray[Any]  # (W, w, 3) of the nodes


@dataclass(frozen=True)
class Regressors:
    """Columns of every window, whitened.

    Attributes
    ----------
    at_lines : complex ndarray, shape (L,)
        The reference that the parabola multiplies,
    at_nodes : complex ndarray, shape (W, 3)
        and at the nodes that the parabola goes through.
    inputs : complex ndarray, shape (J, L)
        Motions that add to the position with a coefficient each.
    """

    at_lines: NDArray[Any]
    at_nodes: NDArray[Any]
    inputs: NDArray[Any]

    @property
    def count(self) -> int:
        """Columns of a window."""
        return self.at_nodes.shape[1] + len(self.inputs)

    def response(self, block: Block) -> NDArray[Any]:
        """What a coefficient of one at each node makes of the force, shape (W, w, 3)."""
        weights = block.weights * (1 / self.at_nodes[block.window, None, :])
        weights *= self.at_lines[block.line, None]
        return weights

    def known(self, block: Block) -> list[NDArray[Any]]:
        """The inputs, shape (W, w, 1) each: none in the padding, which has no force either."""
        return [(row[block.line] * block.whitened)[..., None] for row in self.inputs]


def regressors(
    frequency_hz: NDArray[Any],
    nodes_hz: NDArray[Any],
    reference: Reference,
    inputs: NDArray[Any] | None,
) -> Regressors:
    """At lines of shape (L,) and nodes of shape (W, 3), with inputs of shape (J, L) if any."""
    return Regressors(
        np.asarray(reference(frequency_hz)),
        np.asarray(reference(nodes_hz.ravel())).reshape(nodes_hz.shape),
        np.zeros((0, len(frequency_hz)), complex) if inputs is None else np.asarray(inputs),
    )
