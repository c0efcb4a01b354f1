"""The hand answers its own motion late, through a nerve and a muscle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bayeshaptic.effects.effect import Floats, LinearEffect
from bayeshaptic.effects.registry import register
from bayeshaptic.effects.typical import HAND, apart, grid, place_of, typical
from bayeshaptic.effects.unseen import Unseen, combined
from bayeshaptic.models import HalfNormal, LinearSystem, LogNormal, Model, Parameter
from bayeshaptic.models.response.dynamic_link import Complexes, DynamicLink
from bayeshaptic.recordings.response.etfe import Etfe

DELAYS_S, LAGS_S = (0.015, 0.025, 0.04, 0.07), (0.004, 0.02)  # where to start looking


def reflex_stiffness(
    s: Complexes, stiffness: Floats, damping: Floats, delay_s: Floats, lag_s: Floats
) -> Complexes:
    """(k + b s) e^(-s delay) / (1 + s lag), for `s` of shape (L, 1) or (L, B), values (B,).

    On the imaginary axis, where nearly all points are, compiled.
    """
    if s.ndim != 2 or np.any(s.real):
        return (stiffness + damping * s) * np.exp(-s * delay_s) / (1 + s * lag_s)
    from bayeshaptic.effects.linear.reflex_kernel import on_axis

    k, b, delay, lag = map(np.ascontiguousarray, (stiffness, damping, delay_s, lag_s))
    omega = np.ascontiguousarray(np.broadcast_to(s.imag, (len(s), len(k))))
    found = np.empty(omega.shape, complex)
    on_axis(omega, k, b, delay, lag, found.view(float).reshape(*omega.shape, 2))
    return found


@register
@dataclass(frozen=True)
class Reflex(LinearEffect):
    """A force -(k + b s) e^(-s delay) / (1 + s lag) x on the hand's mass, x its own position."""

    name = "reflex"
    title = "reflex of the hand"
    ties = ("arm_mode",)
    belongs_to = ""
    told_apart_by = "let the person relax, or hold the handle by a clamp of the hand's mass"

    @classmethod
    def candidates(cls, model: Model, etfe: Etfe) -> tuple[LinearEffect, ...]:
        sizes = typical(model, etfe)
        if HAND not in sizes:
            return ()
        stiffness, damping = HalfNormal(3 * sizes["kh"]), HalfNormal(3 * sizes["bh"])
        parameters = (
            Parameter("reflex_stiffness", "stiffness", "spring of the reflex", stiffness),
            Parameter("reflex_damping", "damping", "damper of the reflex", damping),
            Parameter("reflex_delay_s", "time", "delay of the reflex", LogNormal(0.03, 0.6)),
            Parameter("reflex_lag_s", "time", "time constant of the muscle", LogNormal(0.015, 0.7)),
        )
        return (cls(apart(model, parameters)),)

    def starting_values(self, model: Model, etfe: Etfe) -> Floats:
        sizes = typical(model, etfe)
        share = np.array([0.2, 0.7, 2.0])
        return grid(share * sizes["kh"], share * sizes["bh"], DELAYS_S, LAGS_S)

    def unseen(self, model: Model, etfe: Etfe) -> Unseen:
        """Up to the hand's own spring and damper, with the delays of nerves."""
        sizes = typical(model, etfe)

        def own(share: Floats, shapes: Floats) -> Floats:
            return np.column_stack([share * sizes["kh"], share * sizes["bh"], shapes])

        title = "reflex over the hand's own spring and damper"
        return Unseen("number", title, 1.0, own, *combined(DELAYS_S, LAGS_S))

    def apply(self, system: LinearSystem, values: Mapping[str, Floats]) -> LinearSystem:
        hand = place_of(HAND, system.mechanism)
        link = DynamicLink(hand, None, reflex_stiffness, self.own(values))
        return system.with_dynamic_link(link)
