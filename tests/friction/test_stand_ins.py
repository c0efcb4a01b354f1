"""No stiffness where two forces over the velocity were found on a held device."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

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
    closed: Any = SimpleNamespace(analysis=analysis, effect_names=names)
    why = stand_ins(closed)
    assert (why is not None) == said


def test_the_loop_has_no_green_light_beside_that(monkeypatch: pytest.MonkeyPatch) -> None:
    names = ("coulomb_friction", "drag")
    closed: Any = SimpleNamespace(
        analysis=SimpleNamespace(model=SimpleNamespace(held=True), sampled=True),
        effect_names=names,
        force=None,
        verdict="explained",
    )
    monkeypatch.setattr(lights, "misfit_is_clear", lambda _: False)
    result: Any = SimpleNamespace(closed=closed)
    assert lights._loop(result).state == "doubt"
    closed.effect_names = names[:1]
    assert lights._loop(result).state == "good"
