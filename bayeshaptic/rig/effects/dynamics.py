"""Linear effects: more masses, springs and dampers, and more in the loop."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.structure import FRAME, GROUND, Link, Relaxation, Structure
from bayeshaptic.rig.effects.effect import Effect, MotionScales, register


def _mounted(mass: float, frequency_hz: float, damping_ratio: float) -> tuple[float, float]:
    """Stiffness and damping of a mount, from the natural frequency of the mass on it."""
    omega = 2 * np.pi * frequency_hz
    return mass * omega**2, 2 * damping_ratio * mass * omega


@register
@dataclass(frozen=True)
class SecondMode(Effect):
    """A mass hung on another by a spring and a damper.

    Attributes
    ----------
    mass_ratio : float
        The new mass over the one that it hangs on.
    frequency_hz, damping_ratio : float
        Of the new mass alone on its spring.
    on : str
        Node that it hangs on.
    """

    name: ClassVar[str] = "second_mode"
    above_zero: ClassVar[tuple[str, ...]] = ("mass_ratio", "frequency_hz")
    at_least_zero: ClassVar[tuple[str, ...]] = ("damping_ratio",)
    mass_ratio: float = 0.1
    frequency_hz: float = 110.0
    damping_ratio: float = 0.02
    on: str = "m1"

    def build(self, structure: Structure) -> None:
        mass = self.mass_ratio * structure.mass(self.on)
        added = f"{self.name}_{len(structure.masses)}"
        structure.masses[added] = mass
        stiffness, damping = _mounted(mass, self.frequency_hz, self.damping_ratio)
        structure.links.append(Link(added, self.on, stiffness, damping))


@register
@dataclass(frozen=True)
class BaseCompliance(Effect):
    """The device stands on a base that gives: motor, guides and encoder move with it.

    Attributes
    ----------
    mass_ratio : float
        The base over all the masses of the device (without the hand).
    frequency_hz, damping_ratio : float
        Of the base alone on its feet.
    """

    name: ClassVar[str] = "base_compliance"
    above_zero: ClassVar[tuple[str, ...]] = ("mass_ratio", "frequency_hz")
    at_least_zero: ClassVar[tuple[str, ...]] = ("damping_ratio",)
    mass_ratio: float = 4.0
    frequency_hz: float = 25.0
    damping_ratio: float = 0.03

    def build(self, structure: Structure) -> None:
        device = sum(mass for node, mass in structure.masses.items() if node != structure.hand)
        mass = self.mass_ratio * device
        structure.masses[FRAME] = mass
        stiffness, damping = _mounted(mass, self.frequency_hz, self.damping_ratio)
        structure.links.append(Link(FRAME, GROUND, stiffness, damping))


@register
@dataclass(frozen=True)
class CentringStiffness(Effect):
    """A spring from a mass to the frame, such as a cable or gravity in a pendulum.

    Attributes
    ----------
    stiffness : float
        N/m or N m/rad.
    on : str
        The mass that it acts on, by its name.
    """

    name: ClassVar[str] = "centring_stiffness"
    stiffness: float = 20.0
    on: str = "m1"

    @classmethod
    def typical(cls, scales: MotionScales) -> CentringStiffness:
        return cls(0.5 * scales.force / scales.position)

    def build(self, structure: Structure) -> None:
        structure.check(self.on)
        structure.links.append(Link(self.on, FRAME, self.stiffness, 0.0))


@register
@dataclass(frozen=True)
class StructuralDamping(Effect):
    """A loss of `loss_factor` in the connection m1-m2 that hardly depends on the frequency.

    The spring kc (1 + j loss_factor) as Maxwell elements, `elements` of them over `decades` around
    the frequency at which m1 and m2 swing against each other; there the stiffness stays kc, and
    elsewhere it is what causality demands (it grows with log frequency).

    Attributes
    ----------
    loss_factor : float
        Imaginary over real part of the spring at that frequency.
    decades : float
        Of the elements' time constants, evenly spread.
    elements : int
    """

    name: ClassVar[str] = "structural_damping"
    above_zero: ClassVar[tuple[str, ...]] = ("loss_factor", "decades", "elements")
    loss_factor: float = 0.15
    decades: float = 3.0
    elements: int = 7

    def build(self, structure: Structure) -> None:
        link = structure.link("m1", "m2")
        omega = np.sqrt(link.stiffness * (1 / structure.mass("m1") + 1 / structure.mass("m2")))
        time_constants = np.logspace(-self.decades / 2, self.decades / 2, self.elements) / omega
        turns = (omega * time_constants) ** 2
        shares = np.full(self.elements, link.stiffness)
        shares *= self.loss_factor / np.sum(np.sqrt(turns) / (1 + turns))
        relaxed = link.stiffness - np.sum(shares * turns / (1 + turns))
        if relaxed <= 0:
            raise InputError(
                f"a loss factor of {self.loss_factor:g} leaves no static stiffness; choose less"
            )
        structure.replace_link(link, replace(link, stiffness=relaxed))
        structure.relaxations += [
            Relaxation("m1", "m2", share, time_constant)
            for share, time_constant in zip(shares, time_constants, strict=True)
        ]


@register
@dataclass(frozen=True)
class ExtraDelay(Effect):
    """More delay in the loop than the bench declares.

    Attributes
    ----------
    delay_s : float
    """

    name: ClassVar[str] = "extra_delay"
    at_least_zero: ClassVar[tuple[str, ...]] = ("delay_s",)
    delay_s: float = 0.6e-3

    @classmethod
    def typical(cls, scales: MotionScales) -> ExtraDelay:
        return cls(0.6 * scales.period_s)

    def build(self, structure: Structure) -> None:
        structure.delay_s += self.delay_s


@register
@dataclass(frozen=True)
class ActuatorLag(Effect):
    """The force follows the delayed command by 1/(1 + s time_constant_s)^order.

    Attributes
    ----------
    time_constant_s : float
    order : int
    """

    name: ClassVar[str] = "actuator_lag"
    above_zero: ClassVar[tuple[str, ...]] = ("time_constant_s", "order")
    time_constant_s: float = 0.5e-3
    order: int = 1

    def build(self, structure: Structure) -> None:
        structure.lags_s += [self.time_constant_s] * self.order


@register
@dataclass(frozen=True)
class PositionFilter(Effect):
    """An analogue low-pass in front of the encoder: order 1, or order 2 with a damping ratio.

    Attributes
    ----------
    cutoff_hz : float
    order : {1, 2}
    damping_ratio : float
        Of order 2.
    """

    name: ClassVar[str] = "position_filter"
    above_zero: ClassVar[tuple[str, ...]] = ("cutoff_hz", "damping_ratio")
    cutoff_hz: float = 200.0
    order: int = 1
    damping_ratio: float = float(np.sqrt(0.5))

    def build(self, structure: Structure) -> None:
        if self.order not in (1, 2):
            raise InputError(f"a position filter has order 1 or 2, not {self.order}")
        damping = self.damping_ratio if self.order == 2 else None
        structure.filters.append((2 * np.pi * self.cutoff_hz, damping))
