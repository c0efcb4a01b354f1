"""Where a sequence will end that comes nearer by the same share with every step."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.types import Floats

_ALIKE = 0.99  # cosine between two steps that are the same way
_SAME = 0.1  # relative difference of two shares that are the same
_SLOW, _ENDLESS = 0.2, 0.98  # shares below which there is no need, and above which there is no end


@dataclass
class Approach:
    """Points of a sequence on its way to a limit.

    A. C. Aitken, Proc. R. Soc. Edinburgh 46, 289-305, 1926; two steps at a time, because what
    overshoots in one comes back in the next, and only where two shares agree: friction gets nearer
    by leaps.

    Attributes
    ----------
    judged : int
        How many of the first coordinates tell how it converges, relative to their size.
    points : list of ndarray
    """

    judged: int
    points: list[Floats] = field(default_factory=list)

    def ahead(self, point: Floats) -> Floats:
        """Where seven points say that the sequence ends; the point itself where they do not.

        Parameters
        ----------
        point : ndarray, shape (P,)
            The next.
        """
        self.points.append(point)
        if len(self.points) < 7:
            return point
        steps = np.diff(np.array(self.points[-7::2]), axis=0)
        first, middle, last = steps[:, : self.judged] / np.maximum(
            np.abs(point[: self.judged]), 1e-300
        )
        earlier, share = _share(first, middle), _share(middle, last)
        if not (_SLOW < share < _ENDLESS and abs(share - earlier) < _SAME * share):
            return point
        self.points.clear()
        return np.asarray(point + steps[-1] * share / (1.0 - share))


def _share(before: Floats, now: Floats) -> float:
    """How much shorter a step is than the one before; none where it is another way."""
    along = float(before @ now)
    if not along > _ALIKE * np.linalg.norm(before) * np.linalg.norm(now):
        return 0.0
    return along / float(before @ before)
