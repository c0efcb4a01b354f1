"""A force that a law explains, and another beside it that hides in what a law may leave."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.diagnosis.residuals import residual
from bayeshaptic.diagnosis.state import Accepted, Estimate
from bayeshaptic.diagnosis.widening import friction
from bayeshaptic.diagnosis.widening.friction import (
    may_be_held_by_friction,
    with_friction_for_damping,
)
from bayeshaptic.effects.nonlinear.shapes import EXCESS_NOISE
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.report.numbers import stand_ins
from bayeshaptic.report.numbers.stand_ins import is_the_rest
from bayeshaptic.report.objections import _rubs_otherwise


def closed(
    statistic: float, held: bool = False, strength: str = "friction_force", direct: bool = False
) -> Any:
    """A loop that explains a force, and leaves a test over the load's velocity."""
    left = residual.Test("sign(v2)", "nonlinear", statistic, 17.6, None, "", usual=4.4)
    found = Accepted("law", "law", "nonlinear", "", {strength: Estimate(1.0, 0.1, "N")})
    return SimpleNamespace(
        diagnosis={"verdict": "explained"},
        traced=SimpleNamespace(after=(left,)),
        effects=(found,),
        model=SimpleNamespace(held=held),
        analysis=SimpleNamespace(etfe=SimpleNamespace(direct=direct)),
        force=None,
    )


@pytest.mark.parametrize(
    ("what", "objects"),
    [
        (closed(8.6), True),  # a limit 1.47 times too high was recommended
        (closed(3.0), False),
        (closed(8.6, held=True), False),
        (closed(8.6, strength="half_gap"), True),
        (closed(8.6, direct=True), False),  # what it would do is in the interval
    ],
)
def test_what_a_force_leaves_over_the_velocity_counts_where_nobody_holds(
    what: Any, objects: bool
) -> None:
    assert _rubs_otherwise(what) == objects


@pytest.mark.parametrize("share, held", [(0.05, True), (0.01, False)])
def test_noise_beside_a_force_may_be_friction_that_holds(
    share: float, held: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """55 times the limit was recommended: Stribeck's friction had been found, and held on."""
    monkeypatch.setattr(friction, "changing_share", lambda fit, etfe: share)
    state = SimpleNamespace(fit=None, etfe=None)
    noise = residual.Test(EXCESS_NOISE, "nonlinear", 23.8, 9.0, 21.0, "")
    left = residual.Test("sign(v)", "nonlinear", 23.8, 9.0, None, "")
    assert may_be_held_by_friction(None, SimpleNamespace(state=state, after=(noise,))) == held  # type: ignore[arg-type]
    both = SimpleNamespace(state=state, after=(noise, left))
    assert not may_be_held_by_friction(None, both)  # type: ignore[arg-type]


def test_damping_may_be_the_friction_that_would_make_the_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Friction of 0.1 N at 0.1 m/s is a damper of 0.8 N s/m."""
    rng = np.random.default_rng(0)
    velocity = 0.1 * rng.standard_normal(20_000)
    recording = Recording(rng.standard_normal(20_000), np.cumsum(velocity) * 1e-3, 1e-3, "N", "m")
    fit = SimpleNamespace(
        model=SimpleNamespace(names=("m", "b", "kh")), theta=np.array([1.0, 2, 3])
    )

    def left(share: float) -> float:
        monkeypatch.setattr(friction, "changing_share", lambda fit, etfe: share)
        etfe = SimpleNamespace(unbroken=recording)
        theta = with_friction_for_damping(fit, etfe)  # type: ignore[arg-type]
        assert theta[0] == 1 and theta[2] == 3
        return float(theta[1] / 2)

    assert left(0.01) == pytest.approx(1 - 0.5 * 0.8, abs=0.01)
    assert left(1e-6) == pytest.approx(1, abs=0.01)
    assert left(0.5) == 0.2


@pytest.mark.parametrize(
    ("family", "before", "bare", "objects"),
    [
        ("nonlinear", 11.0, None, True),
        ("nonlinear", 9.0, None, False),
        ("linear", 11.0, None, False),
        ("nonlinear", 11.0, 9.0, False),  # a low-pass that was found first moved it most
        ("nonlinear", 9.0, 11.0, True),
    ],
)
def test_a_limit_is_no_small_difference_of_two_large_ones(
    monkeypatch: pytest.MonkeyPatch,
    family: str,
    before: float,
    bare: float | None,
    objects: bool,
) -> None:
    """Of five recordings of a rubbing motor three had 1.8 to 4.4 times the limit in green."""

    def limited(to: float) -> SimpleNamespace:
        return SimpleNamespace(limit=SimpleNamespace(quantile=lambda share: to))

    effects = (SimpleNamespace(family=family),)
    base = limited(before)
    base.fit = SimpleNamespace(model="as declared")
    fit = None if bare is None else SimpleNamespace(model="with a low-pass", theta=np.ones(3))
    what: Any = SimpleNamespace(
        effects=effects,
        base=base,
        analysis=limited(1.0),
        traced=SimpleNamespace(without_forces=fit),
    )
    monkeypatch.setattr(
        stand_ins, "critical_stiffness", lambda model, theta: SimpleNamespace(value=bare)
    )
    assert is_the_rest(what) == objects
