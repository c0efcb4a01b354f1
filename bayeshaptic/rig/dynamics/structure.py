"""What a bench is made of: masses, what joins them, and the chain from command to sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from bayeshaptic.errors import InputError
from bayeshaptic.rig.dynamics.laws import Law

GROUND = "ground"
FRAME = "frame"

PARAMETERS: dict[str, tuple[str, ...]] = {
    "rigid": ("m", "b"),
    "free": ("m1", "b1", "bc", "kc", "m2", "b2"),
    "grasped": ("m1", "b1", "bc", "kc", "m2", "b2", "bs", "ks", "mh", "bh", "kh"),
}


@dataclass(frozen=True)
class Link:
    """A spring and a damper side by side between the nodes `a` and `b`."""

    a: str
    b: str
    stiffness: float
    damping: float


@dataclass(frozen=True)
class Relaxation:
    """A spring and a damper in series (a Maxwell element) between the nodes `a` and `b`."""

    a: str
    b: str
    stiffness: float
    time_constant_s: float


@dataclass(frozen=True)
class DelayedSpring:
    """A force -(stiffness + damping s) e^(-s delay) / (1 + s time_constant) x between two nodes.

    x is the position of `a` relative to `b`; times in s.
    """

    a: str
    b: str
    stiffness: float
    damping: float
    delay_s: float
    time_constant_s: float


@dataclass(frozen=True)
class NodeLaw:
    """A nonlinear force between the nodes `a` and `b`, as a law of their relative motion."""

    a: str
    b: str
    law: Law


@dataclass
class Structure:
    """A bench while it is being put together; effects add to it.

    Nodes are the names of `masses`, "ground", and "frame", the part of the device that does not
    move: the same as ground until a mass of that name is added. The motor pushes `motor` against
    the frame, the encoder reads the position of `motor` from the frame, the person's own forces
    act on `hand` from the ground.

    Attributes
    ----------
    masses : dict of str to float
        kg or kg m^2, in the order of the state.
    motor : str
        The mass that the motor pushes and the encoder reads.
    hand : str or None
        The mass of the hand; None where nobody holds the device.
    links, relaxations, delayed, laws : list
        What joins the nodes.
    lags_s : list of float
        Time constants of the first-order stages between command and force.
    filters : list of tuple
        Low-pass stages between position and encoder: (cut-off in rad/s, damping ratio), the
        damping ratio None for a stage of the first order.
    delay_s : float
        Loop delay, in front of the actuator.
    """

    masses: dict[str, float]
    motor: str
    hand: str | None
    delay_s: float
    links: list[Link] = field(default_factory=list)
    relaxations: list[Relaxation] = field(default_factory=list)
    delayed: list[DelayedSpring] = field(default_factory=list)
    laws: list[NodeLaw] = field(default_factory=list)
    lags_s: list[float] = field(default_factory=list)
    filters: list[tuple[float, float | None]] = field(default_factory=list)

    def mass(self, node: str) -> float:
        """The mass at a node, kg or kg m^2; an `InputError` where the bench has no such mass."""
        self.check(node)
        return self.masses[node]

    def check(self, node: str) -> None:
        """Refuse, by an `InputError`, a mass that the bench does not have."""
        if node not in self.masses:
            raise InputError(f"the bench has no mass '{node}'; it has {', '.join(self.masses)}")

    def link(self, a: str, b: str) -> Link:
        """The link from node `a` to node `b`; an `InputError` where there is none."""
        for link in self.links:
            if (link.a, link.b) == (a, b):
                return link
        raise InputError(f"the bench has no connection between '{a}' and '{b}'")

    def replace_link(self, old: Link, new: Link) -> None:
        """Put another link in the place of one."""
        self.links[self.links.index(old)] = new


def chain(kind: str, values: Mapping[str, float], delay_s: float) -> Structure:
    """The rigid, free or grasped chain of Diaz and Gil (2010), equations (1), (3) and (11).

    Parameters
    ----------
    kind : {"rigid", "free", "grasped"}
    values : mapping of str to float
        Masses, dampers and springs by the paper's names.
    delay_s : float
        Loop delay.

    Returns
    -------
    Structure
        With the nodes m1, m2 and hand; a rigid device has m1 alone.

    Raises
    ------
    InputError
        For an unknown kind, missing or unknown parameters.
    """
    check_parameters(kind, values)
    if kind == "rigid":
        return Structure(
            {"m1": values["m"]}, "m1", None, delay_s, [Link("m1", FRAME, 0.0, values["b"])]
        )
    links = [
        Link("m1", FRAME, 0.0, values["b1"]),
        Link("m1", "m2", values["kc"], values["bc"]),
        Link("m2", FRAME, 0.0, values["b2"]),
    ]
    masses = {"m1": values["m1"], "m2": values["m2"]}
    if kind == "free":
        return Structure(masses, "m1", None, delay_s, links)
    links += [
        Link("m2", "hand", values["ks"], values["bs"]),
        Link("hand", GROUND, values["kh"], values["bh"]),
    ]
    return Structure({**masses, "hand": values["mh"]}, "m1", "hand", delay_s, links)


def check_parameters(kind: str, values: Mapping[str, float]) -> None:
    """Refuse parameters that make no mechanism.

    Raises
    ------
    InputError
        For an unknown mechanism, and parameters that are missing or not its own.
    """
    if kind not in PARAMETERS:
        raise InputError(f"unknown mechanism '{kind}'; choose from {', '.join(PARAMETERS)}")
    missing = [name for name in PARAMETERS[kind] if name not in values]
    unknown = [name for name in values if name not in PARAMETERS[kind]]
    if missing or unknown:
        raise InputError(
            f"a {kind} bench takes the parameters {', '.join(PARAMETERS[kind])}; "
            f"missing: {', '.join(missing) or 'none'}, unknown: {', '.join(unknown) or 'none'}"
        )
