"""What hands are like: the priors of one, and how far a mechanism's hand is from any.

From grams to kilograms, on an arm and behind a grip.  An arm holds it at some 3 Hz (a standard
deviation is a factor 2.2: hardly above 15 Hz), with a damping ratio of some 0.7; a grip at some
25 Hz (factor 2.5) with a ratio of some 0.1.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bayeshaptic.models.prior import LogNormal, Prior
from bayeshaptic.types import Floats

KILOGRAMS = 0.3  # middle of what a hand, or a finger, brings along
_MASS_SD = 2.0  # of logarithms, as all that follow
_ARM, _ARM_SD, _ARM_RATIO, _ARM_RATIO_SD = 2 * np.pi * 3.0, 0.8, 0.7, 1.1
_GRIP, _GRIP_SD, _GRIP_RATIO, _GRIP_RATIO_SD = 2 * np.pi * 25.0, 0.9, 0.1, 1.5


def hand_priors(mass: float) -> dict[str, Prior]:
    """Priors of a hand's parameters around its `mass`, in kg or kg m^2.

    The springs and dampers spread as far as the mass and these rates and ratios together.
    """
    return {
        "mh": LogNormal(mass, _MASS_SD),
        "kh": LogNormal(mass * _ARM**2, float(np.hypot(_MASS_SD, 2 * _ARM_SD))),
        "bh": LogNormal(2 * _ARM_RATIO * mass * _ARM, float(np.hypot(_MASS_SD, _ARM_RATIO_SD))),
        "ks": LogNormal(mass * _GRIP**2, float(np.hypot(_MASS_SD, 2 * _GRIP_SD))),
        "bs": LogNormal(2 * _GRIP_RATIO * mass * _GRIP, float(np.hypot(_MASS_SD, _GRIP_RATIO_SD))),
    }


def from_a_hand(values: Mapping[str, Floats], mass: float) -> Floats:
    """How far parameters are from the middle of what hands are like, in standard deviations.

    Parameters
    ----------
    values : mapping
        Of the hand, "mh", "bs", "ks", "bh" and "kh", to arrays of shape (B,).
    mass : float
        Middle of what hands bring along, kg or kg m^2.

    Returns
    -------
    ndarray, shape (B, 5)
        Of its mass, the rate and the damping ratio of the arm, and those of the grip.
    """
    mh = values["mh"]
    arm, grip = np.sqrt(values["kh"] / mh), np.sqrt(values["ks"] / mh)
    scaled = (
        (mh / mass, _MASS_SD),
        (arm / _ARM, _ARM_SD),
        (values["bh"] / (2 * mh * arm) / _ARM_RATIO, _ARM_RATIO_SD),
        (grip / _GRIP, _GRIP_SD),
        (values["bs"] / (2 * mh * grip) / _GRIP_RATIO, _GRIP_RATIO_SD),
    )
    return np.stack([np.log(ratio) / sd for ratio, sd in scaled], axis=-1)
