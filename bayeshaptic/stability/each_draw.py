"""The critical stiffness of each draw of chains, every different one searched once."""

from __future__ import annotations

import numpy as np

from bayeshaptic.models.model import Model
from bayeshaptic.stability.binding import binding_kinds
from bayeshaptic.stability.crossings import find_crossings
from bayeshaptic.types import Floats, Ints

_TOGETHER = 4096  # draws, whose responses are in memory at a time


def limits_of(
    model: Model, by_chain: Floats, approximation: str, known: Floats | None
) -> tuple[Floats, Floats, Ints]:
    """Critical stiffness, binding frequency and what binds, chain after chain.

    Parameters
    ----------
    model : Model
    by_chain : ndarray, shape (C, S, P)
        Parameter vectors in the order in which they were drawn.
    approximation : {"exact", "continuous"}
    known : ndarray, shape (2, C, K), optional
        Stiffness and frequency of the first draws of each chain.

    Returns
    -------
    stiffness, frequency_hz, kind : ndarray, shape (C * S,)
    """
    assert model.period_s is not None
    moved = np.ones(by_chain.shape[:-1], bool)  # a walker that stays has the limit that it had
    moved[:, 1:] = (by_chain[:, 1:] != by_chain[:, :-1]).any(axis=2)
    wanted, found = moved.copy(), np.empty((2, *moved.shape))
    if known is not None:
        before = min(known.shape[2], by_chain.shape[1])
        found[:, :, :before] = known[:, :, :before]
        wanted[:, :before] = False
    fresh = by_chain[wanted]
    parts: list[Floats] = [np.empty((2, 0))]
    for start in range(0, len(fresh), _TOGETHER):
        system = model.system(fresh[start : start + _TOGETHER])
        crossings = find_crossings(system, model.period_s, approximation)
        parts.append(np.stack([crossings.critical, crossings.binding_hz]))
    found[:, wanted] = np.concatenate(parts, axis=1)
    different, (stiffness, frequency_hz) = by_chain[moved], found[:, moved]
    kinds = [
        binding_kinds(model.system(different[part]), frequency_hz[part], model.period_s)
        for start in range(0, len(different), _TOGETHER)
        for part in [slice(start, start + _TOGETHER)]
    ]
    place = np.cumsum(moved.ravel()) - 1
    return stiffness[place], frequency_hz[place], np.concatenate(kinds)[place]
