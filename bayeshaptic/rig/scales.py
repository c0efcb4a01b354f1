"""How far and how fast a bench moves: what the default strengths of effects are measured by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.integrate

from bayeshaptic.rig.dynamics.plant import Array
from bayeshaptic.rig.effects import MotionScales
from bayeshaptic.rig.noise import tremor_density, wander_density
from bayeshaptic.rig.setup import Setup


def motion_scales(bench: Setup) -> MotionScales:
    """How far and how fast a bench moves under white noise in its band, tremor and wander.

    Root mean squares, from the frequency response of the continuous chain, without hold and delay.

    Parameters
    ----------
    bench : Setup
        Without effects.
    """
    plant = bench.plant()
    frequency = np.geomspace(1e-3, bench.band_hz[1], 4000)
    low, high = bench.band_hz

    def band(f: Array) -> Array:
        return ((f >= low) & (f <= high)).astype(float)

    sources: list[tuple[Array, float, Callable[[Array], Array]]] = [
        (plant.motor, bench.force_rms, band),
        (plant.hand, bench.tremor_rms, tremor_density(bench.tremor_hz)),
        (plant.hand, bench.wander_rms, wander_density(bench.wander_hz)),
    ]
    x1 = plant.position
    stretch = np.zeros(plant.states)
    if "m2" in plant.places:
        stretch[[plant.places["m1"][0], plant.places["m2"][0]]] = 1.0, -1.0
    rows = np.array([x1, x1 @ plant.dynamics, stretch])
    s = 2j * np.pi * frequency[:, None, None] * np.eye(plant.states)
    power = np.zeros(3)
    for column, rms, density in sources:
        if rms > 0 and column.any():
            state = np.linalg.solve(s - plant.dynamics, column[:, None])[..., 0]
            shape = density(frequency)
            shape *= rms**2 / scipy.integrate.trapezoid(shape, frequency)
            power += scipy.integrate.trapezoid(shape * np.abs(rows @ state.T) ** 2, frequency)
    position, velocity, apart = np.sqrt(power).tolist()
    return MotionScales(
        force=bench.force_rms,
        position=position,
        velocity=velocity,
        stretch=apart,
        resolution=bench.encoder_resolution,
        period_s=bench.period_s,
        parameters=bench.values,
    )
