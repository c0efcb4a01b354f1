"""One recording of a study, and what became of it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.result import Result
from bayeshaptic.recordings.from_columns import recording_name
from bayeshaptic.recordings.join import name_of_several
from bayeshaptic.recordings.study import StudyEntry


@dataclass(frozen=True)
class Analysed:
    """One recording of a study, and what became of it.

    Attributes
    ----------
    name : str
        Of the file, without its ending; numbered where two have the same.
    entry : StudyEntry
    result : Result or None
        None where it failed.
    error : str or None
        Why, in one line.
    """

    name: str
    entry: StudyEntry
    result: Result | None = field(default=None, repr=False)
    error: str | None = None

    @property
    def analysis(self) -> Analysis | None:
        """The analysis; of a closed loop that with its effects."""
        return self.result.analysis if self.result else None

    @property
    def effects(self) -> tuple[str, ...]:
        """Names of the effects that were accepted."""
        return self.result.effect_names if self.result else ()


def names_of(entries: Sequence[StudyEntry]) -> list[str]:
    """What recordings are called: as their files, numbered where one name comes more than once.

    Those that count together are called by the first and how many more there are.  No two have one
    name, capitals aside: it is that of a folder, too.

    Parameters
    ----------
    entries : sequence of StudyEntry
    """
    names = [name_of_several(recording_name(one.path), len(one.more)) for one in entries]
    plain = [name.casefold() for name in names]
    taken = {name for name in plain if plain.count(name) == 1}
    found = []
    for name, key in zip(names, plain, strict=True):
        if plain.count(key) > 1:
            number = next(n for n in itertools.count(1) if f"{key}-{n}" not in taken)
            name = f"{name}-{number}"
            taken.add(name.casefold())
        found.append(name)
    return found
