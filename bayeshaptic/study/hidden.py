"""What could hide in a device, by all recordings of a study together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.diagnosis.hidden.hidden import Hidden
from bayeshaptic.diagnosis.hidden.several import Together, all_together
from bayeshaptic.errors import Notice, describe
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.study.analysed import Analysed


@dataclass(frozen=True)
class KnownTogether:
    """The recordings of a study with limits that allow for what all of them know.

    Attributes
    ----------
    recordings : tuple of Analysed
    effects : tuple of Together
        The most probable first; empty where fewer than two recordings say anything.
    notices : tuple of Notice
    """

    recordings: tuple[Analysed, ...]
    effects: tuple[Together, ...] = ()
    notices: tuple[Notice, ...] = ()


def known_together(recordings: Sequence[Analysed], seed: int) -> KnownTogether:
    """The limit of each recording, allowing for what could hide by all recordings.

    Parameters
    ----------
    recordings : sequence of Analysed
    seed : int
    """
    asked = [(i, h) for i, one in enumerate(recordings) if (h := _hidden(one)) is not None]
    if len(asked) < 2:
        return KnownTogether(tuple(recordings))
    try:
        places = [recordings[i].entry.configuration for i, _ in asked]
        found, effects = all_together([hidden for _, hidden in asked], places, seed)
    except Exception as error:  # each recording's own average stands
        text = f"What could hide was not pooled over the recordings: {describe(error)}"
        return KnownTogether(tuple(recordings), notices=(Notice("warning", "hidden", text),))
    every = list(recordings)
    for (i, _), (limit, hidden) in zip(asked, found, strict=True):
        every[i] = _with(every[i], limit, hidden)
    return KnownTogether(tuple(every), effects)


def _hidden(one: Analysed) -> Hidden | None:
    return one.result.analysis.hidden if isinstance(one.result, Closed) else None


def _with(one: Analysed, limit: CriticalStiffness, hidden: Hidden) -> Analysed:
    assert isinstance(one.result, Closed)
    analysis = replace(one.result.analysis, limit=limit, hidden=hidden)
    return replace(one, result=replace(one.result, analysis=analysis))
