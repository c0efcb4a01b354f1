"""A force that a law explains, and another beside it that hides in what a law may leave."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from bayeshaptic.diagnosis.residuals import residual
from bayeshaptic.diagnosis.state import Accepted, Estimate
from bayeshaptic.report.objections import _rubs_otherwise


def closed(statistic: float, held: bool = False, strength: str = "friction_force") -> Any:
    """A loop that explains a force, and leaves a test over the load's velocity."""
    left = residual.Test("sign(v2)", "nonlinear", statistic, 17.6, None, "", usual=4.4)
    found = Accepted("law", "law", "nonlinear", "", {strength: Estimate(1.0, 0.1, "N")})
    return SimpleNamespace(
        diagnosis={"verdict": "explained"},
        traced=SimpleNamespace(after=(left,)),
        effects=(found,),
        model=SimpleNamespace(held=held),
        force=None,
    )


@pytest.mark.parametrize(
    ("what", "objects"),
    [
        (closed(8.6), True),  # a limit 1.47 times too high was recommended
        (closed(3.0), False),
        (closed(8.6, held=True), False),
        (closed(8.6, strength="half_gap"), True),
    ],
)
def test_what_a_force_leaves_over_the_velocity_counts_where_nobody_holds(
    what: Any, objects: bool
) -> None:
    assert _rubs_otherwise(what) == objects
