"""The three base structures of Diaz and Gil (2010): rigid, free, grasped."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.response.mechanism import Link, Mechanism
from bayeshaptic.types import Floats

Values = Mapping[str, Floats]

# name: (dimension, title)
QUANTITIES: dict[str, tuple[str, str]] = {
    "m": ("mass", "mass of the rigid device"),
    "b": ("damping", "damper from the rigid device to the ground"),
    "m1": ("mass", "mass of the motor side"),
    "b1": ("damping", "damper from the motor side to the ground"),
    "bc": ("damping", "damper of the transmission"),
    "kc": ("stiffness", "spring of the transmission"),
    "m2": ("mass", "mass of the device's body"),
    "b2": ("damping", "damper from the body to the ground"),
    "bs": ("damping", "damper between body and hand"),
    "ks": ("stiffness", "spring between body and hand"),
    "mh": ("mass", "mass of the hand"),
    "bh": ("damping", "damper from the hand to the ground"),
    "kh": ("stiffness", "spring from the hand to the ground"),
    "delay_s": ("time", "loop delay"),
}
HAND = ("bs", "ks", "mh", "bh", "kh")
GROUND_DAMPERS = ("b", "b1", "b2")  # hardly seen by the data, and zero in the paper's tables


@dataclass(frozen=True)
class Structure:
    """A base structure: the names of its parameters and how they make a mechanism.

    `build` takes a mapping from name to an array of shape (B,).
    """

    name: str
    names: tuple[str, ...]
    build: Callable[[Values], Mechanism]
    title: str


def _rigid(v: Values) -> Mechanism:
    return Mechanism((v["m"],), (Link(0, None, v["b"], np.zeros_like(v["b"])),))


def _free(v: Values) -> Mechanism:
    zero = np.zeros_like(v["m1"])
    links = (
        Link(0, None, v["b1"], zero),
        Link(0, 1, v["bc"], v["kc"]),
        Link(1, None, v["b2"], zero),
    )
    return Mechanism((v["m1"], v["m2"]), links)


def _grasped(v: Values) -> Mechanism:
    device = _free(v)
    held = device.with_mass(v["mh"], 1, v["bs"], v["ks"])
    return replace(held.with_link(Link(2, None, v["bh"], v["kh"])), hand=2)


RIGID = Structure("rigid", ("m", "b"), _rigid, "one mass and one damper, equation (1)")
FREE = Structure(
    "free",
    ("m1", "b1", "bc", "kc", "m2", "b2"),
    _free,
    "two masses and a transmission, nobody holds it, equation (3)",
)
GRASPED = Structure("grasped", FREE.names + HAND, _grasped, "held by a user, equation (11)")
STRUCTURES = {structure.name: structure for structure in (RIGID, FREE, GRASPED)}
