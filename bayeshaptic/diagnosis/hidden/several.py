"""What several recordings of one device know together of the effects that could hide in it.

An effect of the device (its delay, a lag, friction, a mode) has one size in all of them: what the
others say of that size is one more factor of its likelihood in each, so that their evidence counts
together.  Effects of a hand, and sizes that mean something else in every recording, stay apart.
The other parameters of each recording are its own, and of what else could hide nothing is there.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence, Set
from dataclasses import dataclass

import numpy as np

from bayeshaptic.diagnosis.hidden.average import Told
from bayeshaptic.diagnosis.hidden.evidence import asked
from bayeshaptic.diagnosis.hidden.hidden import Hidden, HiddenEffect, averaged
from bayeshaptic.diagnosis.hidden.weighed import Weighed
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.types import Ints


@dataclass(frozen=True)
class Together:
    """What recordings of one device say of an effect.

    Attributes
    ----------
    name, title : str
    prior : float
        Probability that the device has it, before any recording was looked at.
    alone : tuple of float
        After each recording by itself, of those that could have it.
    together : float or None
        After all of them; None where no two say something of the same one.
    what, unit : str
        What its strength is.
    strength_q95 : (float, float)
        With a probability of 95 % it is no larger, if it is there: by the recording that knows most
        of it, alone and with all the others.
    """

    name: str
    title: str
    prior: float
    alone: tuple[float, ...]
    together: float | None
    what: str
    unit: str
    strength_q95: tuple[float, float]


def all_together(
    every: Sequence[Hidden], configurations: Sequence[Hashable], seed: int = 0
) -> tuple[list[tuple[CriticalStiffness, Hidden]], tuple[Together, ...]]:
    """Each recording's limit by what all of them know, and what that is.

    Parameters
    ----------
    every : sequence of Hidden
        Of each recording.
    configurations : sequence
        Where each was made.
    seed : int

    Returns
    -------
    list of (CriticalStiffness, Hidden), tuple of Together
    """
    told = _told(every, configurations)
    found, shared = [], set()
    for number, one in enumerate(every):
        rng = np.random.default_rng([seed, 15, number])
        shared |= {one.looked.weighed[which].name for which in told[number]}
        looked = one.looked.with_more(told[number], rng)
        found.append(averaged(one.declared, looked, one.prior, rng))
    return found, _table(every, [hidden for _, hidden in found], shared)


def _told(every: Sequence[Hidden], configurations: Sequence[Hashable]) -> list[dict[int, Told]]:
    """What all other recordings say of the same effect at the same place, by its number."""
    groups: dict[Hashable, list[tuple[int, int]]] = {}
    for number, one in enumerate(every):
        for which, own in enumerate(one.looked.weighed):
            if own.evidence is not None:
                where = None if own.shared == "device" else (configurations[number],)
                groups.setdefault((own.name, own.place, where), []).append((number, which))
    told: list[dict[int, Told]] = [{} for _ in every]
    for members in groups.values():
        if len({number for number, _ in members}) > 1:
            weighed = [every[number].looked.weighed[which] for number, which in members]
            said = _by_others(weighed, np.array([number for number, _ in members]))
            for (number, which), others in zip(members, said, strict=True):
                told[number][which] = others
    return [dict(sorted(own.items())) for own in told]


def _by_others(weighed: Sequence[Weighed], number: Ints) -> list[Told]:
    """What the others say of one effect, of each recording; `number` is whose each is.

    Each recording is asked once for the sizes of all: the work in Python would otherwise grow as
    the square of their number.
    """
    evidence = [one.evidence for one in weighed if one.evidence is not None]
    pairs = list(zip(weighed, evidence, strict=True))
    size = np.concatenate([part for one, own in pairs for part in (one.size, own.size)])
    shape = np.concatenate([part for one, own in pairs for part in (one.shape, own.shape)])
    asks = np.repeat(number, [len(one.size) + len(own.size) for one, own in pairs])
    wanted = asked(size, shape)
    said = np.zeros(len(size))
    for own, whose in zip(evidence, number, strict=True):
        said += np.where(asks == whose, 0.0, own.of(wanted))
    ends = np.cumsum([len(part) for one, own in pairs for part in (one.size, own.size)])
    parts = np.split(said, ends[:-1])
    return [Told(*both) for both in zip(parts[::2], parts[1::2], strict=True)]


def _table(
    before: Sequence[Hidden], after: Sequence[Hidden], shared: Set[str]
) -> tuple[Together, ...]:
    rows = []
    for name in dict.fromkeys(effect.name for one in before for effect in one.effects):
        pairs = [
            (old, new)
            for one, other in zip(before, after, strict=True)
            for old, new in zip(_of(one, name), _of(other, name), strict=True)
        ]
        # Of the recording that knows most of it: one that sees sizes far beyond what the others
        # leave has nothing to say of it any more.
        old, new = min(pairs, key=lambda pair: pair[0].strength_q95)
        rows.append(
            Together(
                name,
                old.title,
                old.prior,
                tuple(a.probability for a, _ in pairs),
                new.probability if name in shared else None,
                old.what,
                old.unit,
                (old.strength_q95, new.strength_q95),
            )
        )
    return tuple(sorted(rows, key=lambda row: -(row.together or max(row.alone))))


def _of(hidden: Hidden, name: str) -> list[HiddenEffect]:
    return [effect for effect in hidden.effects if effect.name == name]
