"""Rules of thumb to show beside the limit; each holds for a rigid device only."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.types import Floats


def rigid_limit(
    damping: ArrayLike, delay_s: ArrayLike, period_s: float, virtual_damping: ArrayLike = 0.0
) -> Floats:
    """Stability of a rigid device: K = b / (T/2 + td), and (b + B) / (T/2 + td) with damping B.

    Parameters
    ----------
    damping : array_like
        Viscous damping b of the device to the ground.
    delay_s : array_like
    period_s : float
    virtual_damping : array_like
        B of the wall; the rule is linear, and true for small B only.

    Returns
    -------
    ndarray
        Stiffness in the unit of `damping` over seconds.

    References
    ----------
    Equation (19) of I. Diaz and J. J. Gil, "Influence of Vibration Modes and Human Operator on the
    Stability of Haptic Rendering", IEEE Transactions on Robotics 26(1), 2010.  With B: J. J. Gil,
    E. Sanchez, T. Hulin, C. Preusche and G. Hirzinger, "Stability Boundary for Haptic Rendering:
    Influence of Damping and Delay", Journal of Computing and Information Science in Engineering
    9(1), 2009.
    """
    total = np.asarray(damping, float) + np.asarray(virtual_damping, float)
    return total / (period_s / 2 + np.asarray(delay_s, float))


def passivity_limit(
    damping: ArrayLike, period_s: float, virtual_damping: ArrayLike = 0.0
) -> Floats:
    """Passivity of a rigid device without delay: b > K T/2 + abs(B), so K = 2 (b - abs(B)) / T.

    Parameters
    ----------
    damping : array_like
        Physical damping b to the ground, force over velocity.
    period_s : float
        Sampling period T, s.
    virtual_damping : array_like
        Damping B of the wall, in the unit of `damping`.

    Returns
    -------
    ndarray
        Stiffness; zero where the virtual damping alone exceeds the physical one.

    References
    ----------
    J. E. Colgate and G. G. Schenkel, "Passivity of a Class of Sampled-Data Systems: Application to
    Haptic Interfaces", Journal of Robotic Systems 14(1), 1997.
    """
    surplus = np.asarray(damping, float) - np.abs(virtual_damping)
    return np.maximum(2 * surplus / period_s, 0.0)


def quantisation_limit(
    damping: ArrayLike, coulomb: ArrayLike, resolution: float, period_s: float
) -> Floats:
    """Passivity with a coarse encoder: K <= min(2 b / T, 2 fc / resolution), no delay.

    Parameters
    ----------
    damping : array_like
    coulomb : array_like
        Coulomb friction fc, a force.
    resolution : float
        One encoder count, a position.
    period_s : float

    References
    ----------
    J. J. Abbott and A. M. Okamura, "Effects of Position Quantization and Sampling Rate on
    Virtual-Wall Passivity", IEEE Transactions on Robotics 21(5), 2005.
    """
    viscous = 2 * np.asarray(damping, float) / period_s
    return np.minimum(viscous, 2 * np.asarray(coulomb, float) / resolution)


def ground_damping(system: LinearSystem) -> Floats:
    """Sum of all dampers between a mass and the ground, shape (B,): the b of the rules above."""
    mechanism = system.mechanism
    to_ground = [link.damping for link in mechanism.links if link.second is None]
    return np.sum(to_ground, axis=0) if to_ground else np.zeros(mechanism.batch)
