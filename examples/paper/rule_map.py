"""When is (19), K = b/(T/2 + td), good enough? Maps of its error and of what binds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models import LinearSystem
from bayeshaptic.models.structures import FREE
from bayeshaptic.stability import find_crossings, rigid_limit
from bayeshaptic.stability.binding import MODE, binding_kinds
from bayeshaptic.types import Floats

from .published import delay_s, values

PERIOD_S = 1e-3
MODE_HZ = np.geomspace(20.0, 300.0, 61)
DELAYS_S = np.linspace(0.0, 2e-3, 41)
PRETENSION = np.geomspace(0.4, 2.5, 81)  # of the transmission's stiffness
GOOD_DB = 0.5


@dataclass(frozen=True)
class RuleMap:
    """Over two axes: the error of the rule, and where the crossing jumps.

    Attributes
    ----------
    x, y : ndarray, shape (X,), (Y,)
    error_db : ndarray, shape (Y, X)
        Of (19) against the critical stiffness; positive: the rule promises too much.
    on_mode : ndarray of bool, shape (Y, X)
        Whether the binding crossing lies on the vibration mode instead of the rigid body.
    critical_db : ndarray, shape (Y, X)
    """

    x: Floats = field(repr=False)
    y: Floats = field(repr=False)
    error_db: Floats = field(repr=False)
    on_mode: NDArray[np.bool_] = field(repr=False)
    critical_db: Floats = field(repr=False)


def mode_hz(device: str) -> float:
    """The free device's vibration mode: both masses against each other."""
    v = values(device, "free")
    return float(np.sqrt(v["kc"] * (1 / v["m1"] + 1 / v["m2"])) / (2 * np.pi))


def over_mode_and_delay(device: str) -> RuleMap:
    """A free device whose mode lies elsewhere, with the same damping ratio, and other delays."""
    v = values(device, "free")
    factor = MODE_HZ / mode_hz(device)
    grid_factor, delay = (a.ravel() for a in np.meshgrid(factor, DELAYS_S))
    table = {name: np.full(grid_factor.size, value) for name, value in v.items()}
    table["kc"] = v["kc"] * grid_factor**2
    table["bc"] = v["bc"] * grid_factor
    return _map(MODE_HZ, DELAYS_S, table, delay)


def over_pretension() -> RuleMap:
    """The LHIfAM's cable, tighter or looser, over the delay: kc alone changes."""
    v = values("lhifam", "free")
    factor, delay = (a.ravel() for a in np.meshgrid(PRETENSION, DELAYS_S))
    table = {name: np.full(factor.size, value) for name, value in v.items()}
    table["kc"] = v["kc"] * factor
    return _map(PRETENSION, DELAYS_S, table, delay)


def _map(x: Floats, y: Floats, table: dict[str, Floats], delay: Floats) -> RuleMap:
    system = LinearSystem(FREE.build(table), delay)
    found = find_crossings(system, PERIOD_S)
    rule = rigid_limit(table["b1"] + table["b2"], delay, PERIOD_S)
    on_mode = binding_kinds(system, found.binding_hz, PERIOD_S) == MODE
    shape = (len(y), len(x))
    with np.errstate(divide="ignore", invalid="ignore"):
        error = 20 * np.log10(rule / found.critical)
        critical = 20 * np.log10(found.critical)
    return RuleMap(x, y, error.reshape(shape), on_mode.reshape(shape), critical.reshape(shape))


def jump(pretension: RuleMap) -> float:
    """Where the LHIfAM's limit jumps to the mode at its own delay: a factor on kc."""
    row = int(np.argmin(np.abs(pretension.y - delay_s("lhifam"))))
    on_mode = pretension.on_mode[row]
    edges = np.flatnonzero(np.diff(on_mode.astype(int)))
    return float(np.sqrt(pretension.x[edges[0]] * pretension.x[edges[0] + 1]))
