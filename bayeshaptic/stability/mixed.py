"""One distribution of the critical stiffness from several explanations, each with a probability."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bayeshaptic.stability.binding import BindingCrossing
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.types import Ints


def mixed(
    limit: CriticalStiffness,
    others: Sequence[CriticalStiffness],
    shares: Sequence[float],
    names: Sequence[str],
    rng: np.random.Generator,
) -> CriticalStiffness:
    """`limit` with as many draws of the others in the place of its own as their shares say.

    Parameters
    ----------
    limit : CriticalStiffness
        Its chains stay, but for the draws that are replaced.
    others : sequence of CriticalStiffness
    shares : sequence of float
        Probabilities of the others; the rest is that of `limit`.
    names : sequence of str
        Of the others.
    rng : numpy.random.Generator
    """
    count = len(limit.samples)
    samples, frequency, group = limit.samples.copy(), limit.frequency_hz.copy(), limit.group.copy()
    crossings = list(limit.crossings)
    explained_by, places = np.zeros(count, int), rng.permutation(count)
    edges = np.rint(count * np.concatenate([[0.0], np.cumsum(shares)])).astype(int)
    for which, (other, first) in enumerate(zip(others, edges[:-1], strict=True)):
        rows = places[first : edges[which + 1]]
        explained_by[rows] = which + 1
        drawn = rng.integers(len(other.samples), size=len(rows))
        samples[rows], frequency[rows] = other.samples[drawn], other.frequency_hz[drawn]
        group[rows] = _numbers(crossings, other)[other.group[drawn]]
    share = np.bincount(group, minlength=len(crossings)) / count
    order = np.argsort(-share, kind="stable")
    order = order[share[order] > 0]
    number = np.zeros(len(crossings), int)
    number[order] = np.arange(len(order))
    named = tuple(replace(crossings[i], probability=float(share[i])) for i in order)
    return replace(
        limit,
        samples=samples,
        frequency_hz=frequency,
        crossings=named,
        group=number[group],
        explanations=tuple(names),
        explained_by=explained_by,
    )


def _numbers(crossings: list[BindingCrossing], other: CriticalStiffness) -> Ints:
    """Where the crossings of `other` stand among `crossings`; what is new there is added."""
    found = []
    for own in other.crossings:
        alike = [
            number
            for number, known in enumerate(crossings)
            if known.label.partition(" at ")[0] == own.label.partition(" at ")[0]
        ]
        if not alike:
            crossings.append(own)
            alike = [len(crossings) - 1]
        near = min(alike, key=lambda n: abs(_log(crossings[n]) - _log(own)))
        found.append(near)
    return np.array(found, int)


def _log(crossing: BindingCrossing) -> float:
    return float(np.log(crossing.frequency_hz or 1e-9))
