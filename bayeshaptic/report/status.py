"""How far a stiffness may be relied on: three words and their order, of recordings and studies."""

from __future__ import annotations

from collections.abc import Iterable

SAFE, CAUTION, UNTRUSTED = "safe", "caution", "untrusted"
_FROM_GOOD_TO_BAD = (SAFE, CAUTION, UNTRUSTED)


def status_of(doubts: Iterable[str], parts: Iterable[str] = ()) -> str:
    """The status of a recommendation.

    Parameters
    ----------
    doubts : iterable of str
        What to beware of; any makes it "caution".
    parts : iterable of str
        The status of each that the recommendation is made of: it is no better than the worst.
    """
    own = CAUTION if any(doubts) else SAFE
    return max((own, *parts), key=_FROM_GOOD_TO_BAD.index)
