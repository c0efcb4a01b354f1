"""Files that hold a tree (structures, cells, objects, groups): its vectors by the path to each.

A node is expanded into a mapping (a structure), a list (an array of structures, a cell), an array
(a leaf), text, or None (nothing to read). Programs that log signals write a list of structures with
the signal's name in one of the fields (dSPACE ``rec.Y(i).Name``, Simulink's ``label``): such a
signal is found by that name, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.recordings.readers.reader import Arrays, vectors

# Deeper than this, and longer lists than this, are no recordings: loops, or files made to harm.
DEEPEST = 24
LONGEST_LIST = 2_000
MOST_NODES = 100_000

# Fields that hold the name of a signal, its samples, its times and its unit.
_NAMES = ("Name", "name", "label", "Label")
_SAMPLES = {"Data", "data", "Values", "values"}
_TIMES = {"Time", "time"}
_UNITS = ("Unit", "unit", "Units", "units")

Expand = Callable[[Any], Any]
Pairs = list[tuple[str, NDArray[Any]]]


def named_vectors(tree: Mapping[str, Any], expand: Expand, separator: str = ".") -> Arrays:
    """The vectors of a tree of named nodes.

    Parameters
    ----------
    tree : mapping of str to node
    expand : callable
        From a node to what is in it; see above.
    separator : str
        Joins inner names: ``rec.Y(2).Data``. Items of a list are counted from one.
    """
    walk = _Walk(expand, separator)
    found = dict(walk.below(tree, "", DEEPEST))
    return found | {
        name: values for name, values in walk.called.items() if len(values) and name not in found
    }


class _Walk:
    """A walk through a tree, as far as it is worth going."""

    def __init__(self, expand: Expand, separator: str) -> None:
        self.expand, self.separator = expand, separator
        self.called: Arrays = {}  # signals by the names that the file gives them
        self._nodes_left = MOST_NODES

    def below(self, branch: Mapping[str, Any], prefix: str, depth: int) -> Pairs:
        """The vectors of a branch, each with its path."""
        found: Pairs = []
        for name, node in branch.items():
            self._nodes_left -= 1
            if not isinstance(name, str) or depth == 0 or self._nodes_left < 0:
                continue
            content = self.expand(node)
            if isinstance(content, list) and len(content) <= LONGEST_LIST:
                items = {f"{name}({i})": item for i, item in enumerate(content, start=1)}
                found += self.below(items, prefix, depth - 1)
            elif isinstance(content, Mapping):
                inside = f"{prefix}{name}{self.separator}"
                members = self.below(content, inside, depth - 1)
                self._call_by_name(content, members, inside)
                found += members
            elif isinstance(content, np.ndarray):
                found += vectors(f"{prefix}{name}", content, self.separator).items()
        return found

    def _call_by_name(self, structure: Mapping[str, Any], members: Pairs, inside: str) -> None:
        """Offer the signal of a structure under the name that one of its fields gives."""
        name, unit = self._text(structure, _NAMES), self._text(structure, _UNITS)
        if not name:
            return
        for path, values in members:
            *outer, last = path.removeprefix(inside).split(self.separator)
            if len(values) < 2 or not _SAMPLES.issuperset(outer):
                continue
            if last in _SAMPLES:
                key = f"{name} ({unit})" if unit else name
            elif last in _TIMES:
                key = f"{name}{self.separator}{last}"
            else:
                continue
            if self.called.setdefault(key, values) is not values:  # two of one name: neither
                self.called[key] = values[:0]

    def _text(self, structure: Mapping[str, Any], fields: tuple[str, ...]) -> str:
        for field in fields:
            content = self.expand(structure.get(field))
            if isinstance(content, str) and content.strip():
                return content.strip()
        return ""
