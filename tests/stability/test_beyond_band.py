"""Where something is unexplained, a limit beyond what was measured is none to render walls by."""

from __future__ import annotations

from dataclasses import replace

import pytest
from fake_analysis import fake_closed

from bayeshaptic.diagnosis.closed import Closed
from bayeshaptic.report.beyond_band import beyond_band
from bayeshaptic.report.headline import headline
from bayeshaptic.report.page.next_step import next_steps
from bayeshaptic.stability.binding import BindingCrossing


def at(times: float, verdict: str) -> Closed:
    """A closed loop whose limit lies at so many times the band's upper end."""
    closed = fake_closed(verdict, "linear")
    analysis = closed.analysis
    there = BindingCrossing("vibration mode", times * analysis.etfe.band_hz[1], 0.9)
    below = BindingCrossing("rigid body", 10.0, 0.1)
    analysis.limit = replace(analysis.limit, crossings=(there, below))
    return closed


@pytest.mark.parametrize(
    ("times", "verdict", "refused"),
    [(1.6, "unexplained", True), (0.6, "unexplained", False), (1.6, "consistent", False)],
)
def test_a_limit_beyond_the_band_is_refused_where_something_is_unexplained(
    times: float, verdict: str, refused: bool
) -> None:
    closed = at(times, verdict)
    why = beyond_band(closed)
    assert (why is not None) == refused
    if why is not None:
        assert headline(closed).status == "untrusted"
        assert "the band that was measured" in next_steps(headline(closed), closed)[0].text
