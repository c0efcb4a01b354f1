"""The base structures of Diaz and Gil (2010), rigid, free, grasped, and chains of more masses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bayeshaptic.errors import InputError
from bayeshaptic.models.response.mechanism import Link, Mechanism
from bayeshaptic.types import Floats

Values = Mapping[str, Floats]
_CHAIN, _HELD_CHAIN = "chain-", "grasped-"  # and the number of the device's vibration modes

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
    "force_lag_s": ("time", "lag of the force's sensor"),
}
MOST_MODES = 8
for _number in range(3, MOST_MODES + 2):
    QUANTITIES |= {
        f"m{_number}": ("mass", f"mass number {_number} of the chain"),
        f"c{_number}": ("damping", f"damper between masses {_number - 1} and {_number}"),
        f"k{_number}": ("stiffness", f"spring between masses {_number - 1} and {_number}"),
        f"b{_number}": ("damping", f"damper from mass number {_number} to the ground"),
    }
HAND = ("bs", "ks", "mh", "bh", "kh")
# Hardly seen by the data, and zero in the paper's tables.
GROUND_DAMPERS = ("b", *(f"b{number}" for number in range(1, MOST_MODES + 2)))
MOTOR_DAMPERS = ("b", "b1")  # these hold the motor's own bearings


@dataclass(frozen=True)
class Structure:
    """A base structure: the names of its parameters and how they make a mechanism.

    `build` takes a mapping from name to an array of shape (B,).
    """

    name: str
    names: tuple[str, ...]
    build: Callable[[Values], Mechanism]
    title: str

    @property
    def held(self) -> bool:
        """Whether somebody holds the device."""
        return set(HAND) <= set(self.names)

    @property
    def modes(self) -> int:
        """Vibration modes of the device by itself: one less than its masses."""
        return sum(QUANTITIES[name][0] == "mass" for name in self.names if name != "mh") - 1


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
    return _in_a_hand(_free(v), v)


def _one_in_a_hand(v: Values) -> Mechanism:
    return _in_a_hand(_rigid(v), v)


def _in_a_hand(device: Mechanism, v: Values) -> Mechanism:
    """The device with a hand on its last mass."""
    hand = len(device.masses)
    held = device.with_mass(v["mh"], hand - 1, v["bs"], v["ks"])
    return replace(held.with_link(Link(hand, None, v["bh"], v["kh"])), hand=hand)


RIGID = Structure("rigid", ("m", "b"), _rigid, "one mass and one damper, equation (1)")
FREE = Structure(
    "free",
    ("m1", "b1", "bc", "kc", "m2", "b2"),
    _free,
    "two masses and a transmission, nobody holds it, equation (3)",
)
GRASPED = Structure("grasped", FREE.names + HAND, _grasped, "held by a user, equation (11)")
# What "grasped" is where the transmission does not show: for the choice of a model alone, because a
# limit wants to know of a mode that the band does not show.
ONE_IN_A_HAND = Structure(
    "one-in-a-hand", RIGID.names + HAND, _one_in_a_hand, "one mass, held by a user"
)
STRUCTURES = {structure.name: structure for structure in (RIGID, FREE, GRASPED)}


@dataclass(frozen=True)
class _InARow:
    """Two masses and the `further` ones, each on the one before; workers hand it back, equal."""

    further: tuple[int, ...]
    held: bool

    def __call__(self, v: Values) -> Mechanism:
        mechanism, still = _free(v), np.zeros_like(v["m1"])
        for n in self.further:
            mechanism = mechanism.with_mass(v[f"m{n}"], n - 2, v[f"c{n}"], v[f"k{n}"])
            mechanism = mechanism.with_link(Link(n - 1, None, v[f"b{n}"], still))
        return _in_a_hand(mechanism, v) if self.held else mechanism


@cache
def chain(modes: int, held: bool = False) -> Structure:
    """A device with so many vibration modes, masses in a row; a hand holds the last, or nobody.

    With none it is rigid, with one free, or grasped; each further mass hangs on the one before.

    Raises
    ------
    InputError
        For fewer than none, or one where somebody holds it, or more than eight.
    """
    fewest = 1 if held else 0
    if not fewest <= modes <= MOST_MODES:
        what = "a chain that somebody holds" if held else "a chain"
        raise InputError(f"{what} has {fewest} to {MOST_MODES} vibration modes, not {modes}.")
    if modes < 2:
        return GRASPED if held else (RIGID, FREE)[modes]
    further = tuple(range(3, modes + 2))
    names = tuple(f"{part}{number}" for number in further for part in "mckb")

    who = "a user holds the last" if held else "nobody holds it"
    title = f"{modes + 1} masses in a row, {who}"
    kind, hand = (_HELD_CHAIN, HAND) if held else (_CHAIN, ())
    return Structure(f"{kind}{modes}", FREE.names + names + hand, _InARow(further, held), title)


def structure_named(name: str) -> Structure:
    """The structure called `name`: of `STRUCTURES`, or with N modes "chain-N", held "grasped-N".

    Raises
    ------
    InputError
        If there is none.
    """
    for kind in (_CHAIN, _HELD_CHAIN):
        number = name.removeprefix(kind)
        if number != name and number.isdecimal():
            return chain(int(number), held=kind == _HELD_CHAIN)
    if name == ONE_IN_A_HAND.name:
        return ONE_IN_A_HAND
    if name not in STRUCTURES:
        there = ", ".join((*STRUCTURES, f"{_CHAIN}N"))
        raise InputError(f"no model {name!r}; there are {there}, and {_HELD_CHAIN}N.")
    return STRUCTURES[name]
