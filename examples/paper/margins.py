"""Table III: gain margins from the models, by the exact hold and by the approximation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.models import build_model
from bayeshaptic.stability import critical_stiffness, ground_damping, rigid_limit

from .published import CASES, HALF_UNITS, LEVER_M, TABLES, decibel, delay_s, margin


@dataclass(frozen=True)
class Margin:
    """One row: (gain margin in dB, frequency in Hz) each; the boxes are (lowest, highest)."""

    case: tuple[str, str]
    published: tuple[float, float]
    exact: tuple[float, float]
    continuous: tuple[float, float]
    exact_box_db: tuple[float, float]
    continuous_box_db: tuple[float, float]


@dataclass(frozen=True)
class RigidMargin:
    """The PHANToM's rigid model at the tip, N/m: by (19), its box, and of the sampled loop."""

    published: float
    rule: float
    rule_box: tuple[float, float]
    sampled: float


def table_3() -> list[Margin]:
    """All four rows of Table III."""
    return [_margin(case) for case in CASES]


def _margin(case: tuple[str, str]) -> Margin:
    device, name = case
    both = [_limit(device, name, approximation) for approximation in ("exact", "continuous")]
    (exact, exact_box), (continuous, continuous_box) = both
    return Margin(case, margin(device, name), exact, continuous, exact_box, continuous_box)


def _limit(
    device: str, name: str, approximation: str
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Margin and frequency of the published parameters, and the margins of their rounding box.

    The limit is smooth over the box, so its extremes lie at the two corners that the signs of the
    derivatives point to.
    """
    model = build_model(name, device)
    half = np.array([HALF_UNITS[device, name][key] for key in model.names])
    steps = 0.05 * np.diag(half)
    vectors = np.concatenate([model.values + steps, model.values - steps, model.values[None]])
    found = critical_stiffness(model, vectors, approximation)
    gain = decibel(found.samples)
    size = len(half)
    corner = np.sign(gain[:size] - gain[size : 2 * size]) * half
    box = critical_stiffness(model, model.values + np.stack([-corner, corner]), approximation)
    low, high = decibel(box.samples)
    return (float(gain[-1]), float(found.frequency_hz[-1])), (float(low), float(high))


def rigid_margin() -> RigidMargin:
    """K = b/(T/2 + td), equation (19), of the rigid PHANToM."""
    model = build_model("rigid", "phantom")
    damping = ground_damping(model.system(model.values))
    half = HALF_UNITS["phantom", "rigid"]["b"]
    low, rule, high = (
        rigid_limit(damping + np.array([-half, 0.0, half]), delay_s("phantom"), 1e-3) / LEVER_M**2
    )
    published = TABLES["table_3"]["phantom_rigid"]["critical_stiffness_tip_n_per_m"]
    sampled = critical_stiffness(model).tip(LEVER_M).value
    return RigidMargin(published, float(rule), (float(low), float(high)), sampled)
