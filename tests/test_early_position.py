"""A position written down a sample before its time: less delay than none, and a limit too high."""

import pytest

from bayeshaptic.diagnosis.close_loop import close_loop
from bayeshaptic.recordings.read import recording_from_arrays
from bayeshaptic.report.headline import headline
from bayeshaptic.rig import Bench, WhiteNoise, simulate


@pytest.mark.parametrize(("early", "status"), [(0, "safe"), (1, "untrusted")])
def test_a_delay_that_ends_at_zero_gets_no_stiffness(early: int, status: str) -> None:
    bench = Bench.from_device("phantom")
    made = simulate(bench, WhiteNoise(0.05, 200.0, 0.7, 10.0), seed=3)
    length = len(made.force) - early
    recording = recording_from_arrays(
        made.force[:length],
        made.position[early:],
        bench.period_s,
        force_unit="Nm",
        position_unit="rad",
    )
    closed = close_loop(recording, "free", hidden=False)
    assert ("delay_s" in closed.analysis.fit.impossible) == bool(early)
    told = headline(closed)
    assert told.status == status
    assert ("ends at a bound" in told.sentence) == bool(early)
