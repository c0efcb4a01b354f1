"""Which crossing binds: a kind by the shape of the motion, then groups by frequency."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.numerics.polynomials.polynomial import evaluate
from bayeshaptic.types import Floats, Ints

RIGID, AGAINST_HAND, MODE, NYQUIST, NEVER, NONE = range(6)
TITLES = {
    RIGID: "rigid body",
    AGAINST_HAND: "device against the hand",
    MODE: "vibration mode",
    NYQUIST: "Nyquist frequency",
    NEVER: "unstable at any stiffness",
    NONE: "no crossing",
}
_GAP = 0.1  # crossings of one kind further apart than 10 % are not the same
_SHARE = 0.005  # and hold at least this share of the draws


@dataclass(frozen=True)
class BindingCrossing:
    """One of the crossings that may set the limit.

    Attributes
    ----------
    label : str
        For example "vibration mode at 102 Hz".
    frequency_hz : float or None
        Median over the draws where it binds; None where the loop is never stable.
    probability : float
        Share of the draws where it binds.
    """

    label: str
    frequency_hz: float | None
    probability: float


def binding_kinds(system: LinearSystem, frequency_hz: Floats, period_s: float) -> Ints:
    """What moves at each binding crossing, shape (B,).

    The masses' motions are compared with the motion of the measured one at the crossing: where all
    go along with it the body is rigid, where one of them opposes it a vibration mode carries the
    crossing.

    Parameters
    ----------
    system : LinearSystem
    frequency_hz : ndarray, shape (B,)
        Binding crossing; 0 where the loop is never stable, nan without a crossing.
    period_s : float
    """
    mechanism = system.mechanism
    s = (2j * np.pi * np.nan_to_num(frequency_hz)).astype(complex)
    own = evaluate(mechanism.mutual(mechanism.drive, mechanism.drive), s)
    device_opposes = np.zeros(len(s), bool)
    hand_opposes = np.zeros(len(s), bool)
    for mass in range(len(mechanism.masses)):
        if mass == mechanism.frame:
            continue
        motion = evaluate(mechanism.mutual(mechanism.drive, (mass, mechanism.frame)), s)
        opposes = (motion * np.conj(own)).real < 0
        if mass == mechanism.hand:
            hand_opposes |= opposes
        else:
            device_opposes |= opposes
    kinds = np.where(device_opposes, MODE, np.where(hand_opposes, AGAINST_HAND, RIGID))
    kinds[frequency_hz > 0.5 / period_s * (1 - 1e-6)] = NYQUIST
    kinds[frequency_hz == 0] = NEVER
    kinds[np.isnan(frequency_hz)] = NONE
    return kinds


def group_crossings(kinds: Ints, frequency_hz: Floats) -> tuple[tuple[BindingCrossing, ...], Ints]:
    """Groups of binding crossings, the most probable first, and each draw's group.

    Parameters
    ----------
    kinds : ndarray of int, shape (n,)
    frequency_hz : ndarray, shape (n,)

    Returns
    -------
    crossings : tuple of BindingCrossing
    group : ndarray of int, shape (n,)
        Index into `crossings` for each draw.
    """
    found: list[tuple[BindingCrossing, Ints]] = []
    for kind in np.unique(kinds):
        members = np.flatnonzero(kinds == kind)
        for part in _split(members, frequency_hz, len(kinds)):
            median = float(np.median(frequency_hz[part]))
            has_frequency = kind not in (NEVER, NONE)
            place = _at(median) if has_frequency else ""
            crossing = BindingCrossing(
                TITLES[int(kind)] + place,
                median if has_frequency else None,
                len(part) / len(kinds),
            )
            found.append((crossing, part))
    found = _at_one_place(found)
    found.sort(key=lambda pair: -pair[0].probability)
    group = np.empty(len(kinds), int)
    for number, (_, part) in enumerate(found):
        group[part] = number
    return tuple(crossing for crossing, _ in found), group


def as_known(
    crossings: tuple[BindingCrossing, ...], group: Ints, known: Iterable[BindingCrossing]
) -> tuple[tuple[BindingCrossing, ...], Ints]:
    """Crossings and groups as of `group_crossings`, by the names that they have elsewhere.

    What a model leaves over bends its response.  The phase then crosses a little beside where it
    does without, which is the same crossing; or at another place altogether.

    Parameters
    ----------
    crossings : tuple of BindingCrossing
    group : ndarray of int, shape (n,)
        Which of them binds in each draw.
    known : iterable of BindingCrossing
        Those that have been named already.

    Returns
    -------
    crossings : tuple of BindingCrossing
        Those with one name are one, with the probability of all.
    group : ndarray of int, shape (n,)
    """
    names = [_known_as(one, known) for one in crossings]
    labels = list(dict.fromkeys(one.label for one in names))
    joined = tuple(
        replace(
            next(one for one in names if one.label == label),
            probability=sum(one.probability for one in names if one.label == label),
        )
        for label in labels
    )
    return joined, np.array([labels.index(one.label) for one in names])[group]


def _known_as(crossing: BindingCrossing, known: Iterable[BindingCrossing]) -> BindingCrossing:
    """The known crossing of the same kind nearby, with this one's probability; else this one."""
    beside = 0.25  # of the frequency: as far as the draws of one crossing lie apart anyway
    kind = crossing.label.partition(" at ")[0]
    for one in known:
        if crossing.frequency_hz is None or one.frequency_hz is None:
            continue
        near = abs(crossing.frequency_hz - one.frequency_hz) <= beside * one.frequency_hz
        if near and one.label.partition(" at ")[0] == kind:
            return replace(one, probability=crossing.probability)
    return crossing


def _at(hertz: float) -> str:
    return f" at {hertz:.3g} Hz" if hertz < 999.5 else f" at {hertz / 1e3:.3g} kHz"


def _at_one_place(
    found: list[tuple[BindingCrossing, Ints]],
) -> list[tuple[BindingCrossing, Ints]]:
    """Groups whose labels would name one frequency are one crossing: the larger gives its kind.

    Where a mass hardly moves, its phase decides the kind from draw to draw.
    """
    places: dict[str, list[tuple[BindingCrossing, Ints]]] = {}
    for pair in found:
        places.setdefault(pair[0].label.partition(" at ")[2] or pair[0].label, []).append(pair)
    joined = []
    for pairs in places.values():
        first = max((pair[0] for pair in pairs), key=lambda one: one.probability)
        whole = sum(one.probability for one, _ in pairs)
        joined.append(
            (replace(first, probability=whole), np.concatenate([part for _, part in pairs]))
        )
    return joined


def _split(members: Ints, frequency_hz: Floats, draws: int) -> list[Ints]:
    """Members of one kind, parted at wide gaps in frequency that leave enough on both sides."""
    members = members[np.argsort(frequency_hz[members])]
    frequency = frequency_hz[members]
    least = max(_SHARE * draws, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        wide = np.flatnonzero(np.diff(np.log(frequency)) > _GAP) + 1
    parts: list[Ints] = []
    start = 0
    for cut in wide.tolist():
        if cut - start >= least and len(members) - cut >= least:
            parts.append(members[start:cut])
            start = cut
    return [*parts, members[start:]]
