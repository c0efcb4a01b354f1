"""Names of effects and of tests in words."""

from __future__ import annotations

from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.residuals.ripples import WAVES
from bayeshaptic.diagnosis.residuals.supply import LIMIT, SPEED
from bayeshaptic.effects.laws import tested
from bayeshaptic.effects.library import effects

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.residuals.residual import Test

_TESTS = {
    "bands": "residual, band by band",
    "total": "residual over all frequencies",
    "smooth change": "a smooth change of the response",
    "a steady change": "a steady change during the recording",
    "a change and back": "a change during the recording, and back",
    SPEED: "a command that gives less at speed, like u |v|",
    LIMIT: "a limit of the actuator that is lower at speed",
    **{wave.test: wave.title for wave in WAVES},
}


def question(test: Test) -> str:
    """What a test asks."""
    shape = tested().get(test.name)
    return shape.title if shape else _TESTS.get(test.name) or title_of(test.name)


def title_of(name: str) -> str:
    """An effect's title, from the name that files and commands use."""
    known = {effect.name: effect.title for effect in effects()}
    return str(known.get(name, name.replace("_", " ")))
