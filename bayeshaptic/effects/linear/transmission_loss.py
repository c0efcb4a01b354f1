"""Losses in the transmission that no single damper describes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import BODY, MASSES, MOTOR, Typical, apart, grid, typical
from bayeshaptic.effects.unseen import Unseen, alone, combined
from bayeshaptic.models import HalfNormal, LinearSystem, LogNormal, Model, Parameter, Uniform
from bayeshaptic.models.response.dynamic_link import Complexes, DynamicLink
from bayeshaptic.recordings.response.etfe import Etfe

_ENDS = (MASSES[MOTOR], MASSES[BODY])
# The rates of relaxation span so much on either side of the usual one; the largest loss factor.
_SPECTRUM, _MOST = 100.0, 0.33


def lossy_stiffness(
    s: Complexes, stiffness: Floats, rate: Floats, loss_factor: Floats
) -> Complexes:
    """What a spring k gains by a loss factor eta: k (1 + j eta) at `rate`, less k.

    A constant loss factor is not causal; k sqrt(1 + eta^2) (s / rate)^(2/pi atan eta) is, has the
    same loss factor everywhere, and stiffens a little with the frequency.
    """
    power = 2 / np.pi * np.arctan(loss_factor)
    size = stiffness * np.sqrt(1 + loss_factor**2)
    grown = np.exp(power * (np.log(np.abs(s)) - np.log(rate))) * size
    angle = 0.5 * np.pi * power
    found = np.empty(grown.shape, complex)
    np.multiply(grown, np.cos(angle), out=found.real)
    found.real -= stiffness
    np.multiply(grown, np.where(s.imag < 0, -1.0, 1.0) * np.sin(angle), out=found.imag)
    return found


def relaxing_spectrum(
    s: Complexes, stiffness: Floats, rate: Floats, loss_factor: Floats
) -> Complexes:
    """The same at `rate`, with a constant loss modulus: Maxwell elements evenly over log time.

    They span _SPECTRUM on either side of `rate` (H. P. Liu, D. L. Anderson, H. Kanamori,
    Geophysical Journal International 47, 1976); what is left for static loads is positive up to a
    loss factor of _MOST.
    """
    strength = loss_factor * stiffness / (np.arctan(_SPECTRUM) - np.arctan(1 / _SPECTRUM))
    if np.any(s.real):
        wide = (1 + s * _SPECTRUM / rate) / (1 + s / (_SPECTRUM * rate))
        return np.asarray(strength * (np.log(wide) - np.log(_SPECTRUM)))
    # On the imaginary axis, where nearly all points are, in real numbers: a third of the time.
    fast = s.imag * (_SPECTRUM / rate)
    square = fast**2
    ratio = (1 + square) / (_SPECTRUM**2 + square / _SPECTRUM**2)
    # The tangent of the difference of two angles.
    turn = fast * (1 - _SPECTRUM**-2) / (1 + square / _SPECTRUM**2)
    found = np.empty(fast.shape, complex)
    np.multiply(0.5 * strength, np.log(ratio), out=found.real)
    np.multiply(strength, np.arctan(turn), out=found.imag)
    return found


_LAWS = {"factor": lossy_stiffness, "modulus": relaxing_spectrum}


@register
@dataclass(frozen=True)
class StructuralDamping(LinearEffect):
    """The transmission's spring loses energy at every frequency, slow motion included.

    kc (1 + j loss_factor) at the frequency at which motor and body swing against each other; the
    damper bc stays beside it.

    Attributes
    ----------
    constant : {"factor", "modulus"}
        What is the same at all frequencies: the loss over the stiffness, or the loss itself.
    """

    constant: str = "factor"

    name = "structural_damping"
    title = "structural damping of the transmission"
    ties = ("relaxing_transmission",)
    told_apart_by = "the same device with its mode elsewhere: a known mass on its body"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        if "kc" not in model.names:
            return ()
        title = "loss factor of the transmission"
        priors = {"factor": HalfNormal(0.3), "modulus": Uniform(0.0, _MOST)}
        return tuple(
            cls(apart(model, (Parameter("loss_factor", "number", title, prior),)), constant)
            for constant, prior in priors.items()
        )

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        return np.array([[0.02], [0.06], [0.12], [0.25]])

    def unseen(self, model: Model, etfe: Etfe) -> Unseen | None:
        """A loss factor up to a third; the two laws are alike while it is small."""
        return Unseen("number", "loss factor", _MOST, alone) if self.constant == "factor" else None

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        (loss_factor,) = self.own(values)
        spring = values["kc"]
        rate = np.sqrt(spring * (1 / values[MOTOR] + 1 / values[BODY]))
        link = DynamicLink(*_ENDS, _LAWS[self.constant], (spring, rate, loss_factor))
        return system.with_dynamic_link(link)


def relaxing_stiffness(s: Complexes, stiffness: Floats, time_s: Floats) -> Complexes:
    """A spring and a damper in series: k s t / (1 + s t)."""
    return stiffness * s * time_s / (1 + s * time_s)


@register
@dataclass(frozen=True)
class RelaxingTransmission(LinearEffect):
    """A spring that a damper lets go (Maxwell) beside the transmission's own: a standard solid.

    A belt, a rubber coupling, a cable on its sheaves: stiffer when fast than when slow.
    """

    name = "relaxing_transmission"
    title = "viscoelastic transmission"
    ties = ("structural_damping",)
    told_apart_by = StructuralDamping.told_apart_by

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        if "kc" not in model.names:
            return ()
        sizes = typical(model, etfe)
        stiffness = LogNormal(0.3 * sizes["kc"], 1.5)
        time_s = LogNormal(1 / cls._rate(sizes), 2.0)
        parameters = (
            Parameter("relaxing_stiffness", "stiffness", "spring that relaxes", stiffness),
            Parameter("relaxation_s", "time", "time in which it relaxes", time_s),
        )
        return (cls(apart(model, parameters)),)

    @staticmethod
    def _rate(sizes: Typical) -> float:
        return float(np.sqrt(sizes["kc"] * (1 / sizes[MOTOR] + 1 / sizes[BODY])))

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        sizes = typical(model, etfe)
        stiffness = sizes["kc"] * np.array([0.05, 0.2, 1.0])
        return grid(stiffness, np.geomspace(0.03, 30, 7) / self._rate(sizes))

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """Up to the transmission's own spring, relaxing thirty times slower to ten times faster.

        Faster than that it is a damper, which the model has.
        """
        sizes = typical(model, etfe)

        def own(share: Floats, shapes: Floats) -> Floats:
            return np.stack([share * sizes["kc"], shapes[:, 0]], axis=1)

        times = np.geomspace(0.1, 30, 6) / self._rate(sizes)
        title = "spring that relaxes over the other"
        return Unseen("number", title, 1.0, own, *combined(times))

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        stiffness, time_s = own = self.own(values)
        ratio = (
            np.stack([np.zeros_like(time_s), stiffness * time_s]),
            np.stack([np.ones_like(time_s), time_s]),
        )
        return system.with_dynamic_link(DynamicLink(*_ENDS, relaxing_stiffness, own, ratio))
