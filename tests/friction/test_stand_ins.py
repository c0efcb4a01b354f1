"""No stiffness where two forces over the velocity were found on a held device."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bayeshaptic.effects.nonlinear.drag import Drag
from bayeshaptic.effects.nonlinear.springs import HardeningSpring
from bayeshaptic.report.numbers.stand_ins import stand_ins
from bayeshaptic.report.page import lights


@pytest.mark.parametrize(
    ("held", "names", "said"),
    [
        (True, ("stribeck_friction", "cubic_damping"), True),
        (True, ("coulomb_friction", "drag"), True),
        (False, ("coulomb_friction", "drag"), False),  # every interval of such pairs holds
        (True, ("coulomb_friction",), False),
        (True, ("coulomb_friction", "hardening_spring"), False),
        (True, ("coulomb_friction", "actuator_saturation"), False),
        (True, ("coulomb_friction", "second_mode"), False),
        (True, ("gain_along_the_way",), False),  # found without a law
    ],
)
def test_a_pair_over_the_velocity_of_a_held_device_is_a_reason_against_its_limit(
    held: bool, names: tuple[str, ...], said: bool
) -> None:
    analysis: Any = SimpleNamespace(model=SimpleNamespace(held=held))
    traced = SimpleNamespace(skipped=())
    closed: Any = SimpleNamespace(analysis=analysis, effect_names=names, traced=traced)
    why = stand_ins(closed)
    assert (why is not None) == said


@pytest.mark.parametrize(
    ("held", "name", "skipped", "said"),
    [
        (True, "cubic_damping", Drag.title, True),
        (True, "cubic_damping", f"{Drag.title}, its fit", True),
        (False, "cubic_damping", Drag.title, False),
        (True, "cubic_damping", HardeningSpring.title, False),
        (True, "hardening_spring", Drag.title, False),
    ],
)
def test_a_search_that_its_budget_ended_leaves_a_held_devices_limit_open(
    held: bool, name: str, skipped: str, said: bool
) -> None:
    """Cubic damping stood for friction and a drag, with 1.37 times the limit in green."""
    closed: Any = SimpleNamespace(
        analysis=SimpleNamespace(model=SimpleNamespace(held=held)),
        effect_names=(name,),
        traced=SimpleNamespace(skipped=(skipped,)),
    )
    why = stand_ins(closed)
    assert (why is not None) == said
    assert why is None or Drag.title in why


@pytest.mark.parametrize(
    ("damping", "force", "said"),
    [(0.05, "coulomb_friction", True), (0.7, "coulomb_friction", False), (0.05, None, False)],
)
def test_friction_behind_what_rings_leaves_the_limit_open(
    damping: float, force: str | None, said: bool
) -> None:
    """A motor that rubs, read behind a spring, had 1.07 times its limit in green."""
    model = SimpleNamespace(held=False, names=("m", "filter_hz", "filter_damping"))
    fit = SimpleNamespace(model=model, theta=np.array([1.0, 10.0, damping]))
    closed: Any = SimpleNamespace(
        analysis=SimpleNamespace(model=model, fit=fit),
        effect_names=("position_filter", *((force,) if force else ())),
        traced=SimpleNamespace(skipped=()),
    )
    assert (stand_ins(closed) is not None) == said


def test_the_loop_has_no_green_light_beside_that(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("coulomb_friction", "drag")
    closed: Any = SimpleNamespace(
        analysis=SimpleNamespace(model=SimpleNamespace(held=True), sampled=True),
        effect_names=names,
        traced=SimpleNamespace(skipped=()),
        force=None,
        verdict="explained",
    )
    monkeypatch.setattr(lights, "misfit_is_clear", lambda _: False)
    result: Any = SimpleNamespace(closed=closed)
    assert lights._loop(result).state == "doubt"
    closed.effect_names = names[:1]
    assert lights._loop(result).state == "good"
