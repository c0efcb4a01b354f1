"""Several things in one sentence."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

_OFTEN = {2: "twice", 3: "three times"}


def listed(parts: Iterable[str]) -> str:
    """ "a", "a and b", "a, b and c"; what comes several times once: "a (twice) and b"."""
    counts = Counter(iter(parts))  # of a mapping its keys
    *first, last = [_counted(part, count) for part, count in counts.items()] or [""]
    return f"{', '.join(first)} and {last}" if first else last


def _counted(part: str, count: int) -> str:
    return part if count == 1 else f"{part} ({_OFTEN.get(count, f'{count} times')})"
