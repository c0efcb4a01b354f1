"""Which terms explain a force: chosen by what they predict, with what the choice leaves open.

Short records do not say which law of friction theirs is, and laws of one force share it out among
mass, damping and friction in their own ways.  So the simplest law comes first, others must bring
far more, and the errors of the coefficients hold how they differ between sets of terms that predict
about as well (J. A. Hoeting et al., "Bayesian model averaging", Statistical Science 14, 1999).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.numerics.gauss_newton import lengths
from bayeshaptic.types import Bools, Floats

SIMPLEST, LAG = "coulomb", "jerk"
# Share of the held-out error, of both halves, that the simplest law must take away, and any other
# term.  Of 96 closed loops of 1.5 and 4 s, 70 of them with dry friction: at (0.1, 0.3) friction is
# named in 66, and in 2 of 26 without; at (0.02, 0.02), with whichever law is best first, in 40 and
# none, and masses from 1.5 s of steps are off by 7 standard deviations rms, where with these
# numbers it is 0.9.
_SIMPLEST_WORTH, _WORTH = 0.1, 0.3
# A longer record needs less: in proportion beyond so many seconds, down to a fiftieth.
_SHORT_S, _LEAST_WORTH = 4.0, 0.02
# Errors that a recording counts for when sets are weighed: what is left is no white noise.  Errors
# of mass, damping and friction over their standard deviations, rms, in 166 closed loops of 0.7 to
# 12 s: 0.90, 0.63, 0.63 with 3 of them, 1.06, 1.10, 1.21 with 30, 1.15, 2.12, 1.23 with 100.
_COUNT = 30.0
_ITS_OWN = 1e-3  # of a column's power, or it is no new term: a tone's spring is a mass


@dataclass(frozen=True)
class Addition:
    """One round: the term that was added and the held-out rms error of the force with it."""

    term: str
    held_out_rms: float


@dataclass(frozen=True)
class Regression:
    """A force, and the terms that may explain it.

    Attributes
    ----------
    columns : mapping of str to ndarray, shape (N,)
        Of the terms.
    force : ndarray, shape (N,)
    start : sequence of str
        Terms that are there in any case.
    positive : set of str
        Terms that are nothing below zero: no other may make them that.  In steps under a controller
        a spring does: the controller is one.
    """

    columns: Mapping[str, Floats]
    force: Floats
    start: Sequence[str]
    positive: Set[str] = frozenset()

    def where(self, some: Bools) -> Regression:
        """The same of some samples alone."""
        columns = {name: column[some] for name, column in self.columns.items()}
        return replace(self, columns=columns, force=self.force[some])

    def design(self, names: Sequence[str]) -> Floats:
        """The columns of these terms, shape (N, J)."""
        return np.stack([self.columns[name] for name in names], axis=1)

    def possible(self, names: Sequence[str]) -> bool:
        """Whether no term is below zero that cannot be."""
        value = np.linalg.lstsq(self.design(names), self.force, rcond=None)[0]
        return all(v >= 0 for name, v in zip(names, value, strict=True) if name in self.positive)

    def says_more(self, chosen: Sequence[str], name: str) -> bool:
        """Whether a column is more than a combination of those chosen."""
        design, column = self.design(chosen), self.columns[name]
        design = design / lengths(design)
        left = column - design @ np.linalg.lstsq(design, column, rcond=None)[0]
        return bool(left @ left > _ITS_OWN * (column @ column))

    def held_out(self, names: Sequence[str]) -> tuple[float, Floats]:
        """Rms error of each half with the other half's coefficients: together, and a half, (2,)."""
        design, force = self.design(names), self.force
        first = np.arange(len(force)) < len(force) // 2
        squares = []
        for own in (first, ~first):
            value = np.linalg.lstsq(design[~own], force[~own], rcond=None)[0]
            squares.append(np.mean((force[own] - design[own] @ value) ** 2))
        return float(np.sqrt(np.mean(squares))), np.sqrt(np.array(squares, dtype=np.float64))


def choose_terms(
    asked: Regression, seconds: float
) -> tuple[list[str], list[Addition], list[Addition]]:
    """The terms that earn their place beside those to start with.

    Parameters
    ----------
    asked : Regression
    seconds : float
        How long the device moves.

    Returns
    -------
    chosen : list of str
    steps, tried : list of Addition
        What was added, and what did not earn its place.
    """
    chosen, steps = list(asked.start), [Addition("linear", asked.held_out(asked.start)[0])]
    enough = max(_WORTH * min(1.0, _SHORT_S / seconds), _LEAST_WORTH)
    rounds = ((SIMPLEST,), min(_SIMPLEST_WORTH, enough)), (tuple(asked.columns), enough)
    tried: list[Addition] = []
    for names, worth in rounds:
        tried = _grow(asked, names, worth, chosen, steps)
    return chosen, steps, tried


def _grow(
    asked: Regression, names: Sequence[str], worth: float, chosen: list[str], steps: list[Addition]
) -> list[Addition]:
    """Add terms to `chosen` while both halves gain; what is left over comes back."""
    while True:
        _, halves = asked.held_out(chosen)
        found = {
            name: asked.held_out([*chosen, name])
            for name in names
            if name not in chosen
            and asked.says_more(chosen, name)
            and asked.possible([*chosen, name])
        }
        order = sorted(found, key=lambda name: found[name][0])
        if not order or np.any(found[order[0]][1] > (1 - worth) * halves):
            return [Addition(name, found[name][0]) for name in order]
        chosen.append(order[0])
        steps.append(Addition(order[0], found[order[0]][0]))


def between_sets(asked: Regression, chosen: Sequence[str], value: Floats) -> Floats:
    """How far coefficients are from those of other sets that predict about as well, rms, (J,).

    The others have a term more, less, or another one instead; or none, or the simplest law alone,
    as it is and with the lag that a controller's samples make.

    Parameters
    ----------
    asked : Regression
    chosen : sequence of str
    value : ndarray, shape (J,)
        Of the chosen terms.
    """
    own = frozenset(chosen[len(asked.start) :])
    others = [name for name in asked.columns if name not in asked.start and name not in own]
    sets = {own, frozenset(), frozenset({SIMPLEST}), frozenset({SIMPLEST, LAG})}
    sets |= {own - {out} for out in own} | {own | {more} for more in others}
    sets |= {own - {out} | {more} for out in own for more in others}
    errors, found = [], []
    for one in sorted(sets, key=sorted):
        names = [*asked.start, *sorted(one)]
        design = asked.design(names)
        scale = lengths(design)
        if np.linalg.cond(design / scale) > 1 / _ITS_OWN**2:
            continue
        fit = np.linalg.lstsq(design / scale, asked.force, rcond=None)[0] / scale
        fitted = dict(zip(names, fit.tolist(), strict=True))
        errors.append(np.log(asked.held_out(names)[0]) + len(one) / _COUNT)
        found.append([fitted.get(name, 0.0) for name in chosen])
    weight = np.exp(-_COUNT * (np.array(errors) - min(errors)))
    return np.asarray(np.sqrt(weight @ (np.array(found) - value) ** 2 / weight.sum()))
