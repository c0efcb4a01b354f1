"""What a report computes, counted: the same on every machine, unlike seconds.

A count that doubles is a slower package, wherever the tests run.  The numbers are those of the
version that last changed them; the comment says what they are made of.
"""

from __future__ import annotations

from typing import Any

import pytest
from on_the_bench import recorded_on, usual_noise

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.numerics.spending import metered
from bayeshaptic.rig import Bench

# Held?, effect, its fields, device file? -> millions of values of a rational model at a frequency.
COUNTED: list[tuple[bool, str | None, dict[str, Any], bool, float]] = [
    # 48 starts of the fit, 40,000 draws and more, what could hide
    (False, None, {}, True, 20),
    # five parameters more, and starting values from the data alone; 12 of these for ground dampers
    # that may be zero
    (True, None, {}, False, 41),
    # all linear effects sieved and a few followed; two posteriors, before and after
    (False, "second_mode", {"frequency_hz": 110.0, "mass_ratio": 0.1}, True, 57),
]


@pytest.mark.parametrize(("held", "effect", "fields", "with_file", "millions"), COUNTED)
def test_a_report_evaluates_no_more_than_twice_what_it_did(
    held: bool, effect: str | None, fields: dict[str, Any], with_file: bool, millions: float
) -> None:
    bench = Bench.from_device("lhifam", held=held)
    if effect is not None:
        bench = bench.with_effect(effect, **fields)
    recording = recorded_on(bench, usual_noise(bench, 8.0), seed=8)
    known = {"device": "lhifam"} if with_file else {"delay_s": bench.delay_s}
    with metered() as meter:
        close_loop(recording, "grasped" if held else "free", **known)
    assert 0.5 * millions < meter.spent / 1e6 < 2 * millions
