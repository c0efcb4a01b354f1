"""What a report is about: an analysis, or a closed loop with an analysis before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.stability.critical import CriticalStiffness


def analysis_of(result: Any) -> Analysis:
    """The analysis itself, of an analysis or of what closing the loop returns."""
    return getattr(result, "analysis", result)


def closed_of(result: Any) -> Closed | None:
    """The closed loop, where there is one."""
    return result if hasattr(result, "traced") else None


def measured_of(result: Any) -> Analysis:
    """The analysis of the recording as it was measured, before effects changed or cut it."""
    closed = closed_of(result)
    return analysis_of(result) if closed is None else closed.base


def families_of(result: Any) -> frozenset[str]:
    """The classes of what closing the loop found; empty without it."""
    closed = closed_of(result)
    return frozenset() if closed is None else frozenset(e.family for e in closed.effects)


def is_unexplained(result: Any) -> bool:
    """Whether closing the loop left something without a name."""
    return (getattr(result, "diagnosis", None) or {}).get("verdict") == "unexplained"


def tip_limit(analysis: Analysis) -> CriticalStiffness | None:
    """The limit at the tip in N/m; None without a lever arm or without a torque in N m."""
    if analysis.lever_m is None or analysis.limit.unit != "N m/rad":
        return None
    return analysis.limit.tip(analysis.lever_m)
