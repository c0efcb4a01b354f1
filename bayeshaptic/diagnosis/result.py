"""What a report is made from: an analysis, or a closed loop with an analysis in it."""

from __future__ import annotations

from typing import Protocol

from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.closed import Closed


class Result(Protocol):
    """The common face of `Analysis` and `Closed`."""

    @property
    def analysis(self) -> Analysis:
        """The analysis to report; of a closed loop that with its effects."""
        ...

    @property
    def measured(self) -> Analysis:
        """The analysis of the measurement as it was, before anything was taken off."""
        ...

    @property
    def closed(self) -> Closed | None:
        """The closed loop; None where nobody closed it."""
        ...

    @property
    def effect_names(self) -> tuple[str, ...]:
        """Names of the effects that were accepted."""
        ...
