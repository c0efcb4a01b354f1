"""Units of what is recorded: the base units of the package, and multiples turned into them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping

from bayeshaptic.devices.device import KINDS, kind_of
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.recordings.recording import FORCE_UNITS, POSITION_UNITS

# unit -> (base unit, factor)
_TIME = {"s": ("s", 1.0), "ms": ("s", 1e-3), "us": ("s", 1e-6), "ns": ("s", 1e-9)}
_FORCE = {
    "N": ("N", 1.0),
    "mN": ("N", 1e-3),
    "uN": ("N", 1e-6),
    "kN": ("N", 1e3),
    "Nm": ("Nm", 1.0),
    "mNm": ("Nm", 1e-3),
    "uNm": ("Nm", 1e-6),
    "Nmm": ("Nm", 1e-3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
}
_POSITION = {
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "cm": ("m", 1e-2),
    "um": ("m", 1e-6),
    "nm": ("m", 1e-9),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "urad": ("rad", 1e-6),
    "deg": ("rad", math.pi / 180),
}
_VELOCITY = {
    "m/s": ("m", 1.0),
    "mm/s": ("m", 1e-3),
    "rad/s": ("rad", 1.0),
    "deg/s": ("rad", math.pi / 180),
    "rpm": ("rad", math.pi / 30),
}
_ACCELERATION = {
    "m/s^2": ("m", 1.0),
    "m/s2": ("m", 1.0),
    "mm/s^2": ("m", 1e-3),
    "rad/s^2": ("rad", 1.0),
    "rad/s2": ("rad", 1.0),
}
# Units of other things, and of these in other systems: known as units, and not turned into others.
_FOREIGN = """
    V mV kV Hz kHz K C degC % counts count cnt inc incr ticks tick steps pulses lsb kg g kgf gf lb
    lbf oz in inch ft min h rev turns
"""
# As they are written out.
_WRITTEN_OUT = {
    word: unit
    for unit, words in {
        "s": "sec second seconds",
        "ms": "msec millis millisec millisecond milliseconds",
        "us": "usec micros microsecond microseconds",
        "N": "newton newtons",
        "A": "amp amps ampere amperes",
        "m": "metre metres meter meters",
        "rad": "radian radians",
        "deg": "degree degrees",
        "V": "volt volts",
        "rpm": "rpm",
    }.items()
    for word in words.split()
}
# What is measured in them, by words that names of such signals have.
_BY_NAME = {
    "force": {"Nm": r"torque|moment|\btau", "A": r"current|strom|^i$|iq", "N": r"force|kraft|^f$"},
    "position": {"rad": r"angle|winkel|theta|phi", "m": r"pos|weg|displ|^x$"},
}
_CURES = {
    "force": "; multiply other units by the force constant, as in force=volts*35.15[N]",
    "position": "; multiply counts by the size of one, as in position=counts*3.1e-6[m]",
}
# What drives an amplifier, and is no force until its gain is known; and one unit of it.
_DRIVES = {
    ("volts", "one volt"): r"(?i:volt|\bdac(?![a-z]))|(?<![A-Za-z])m?V$",
    ("a duty cycle", "one unit of it"): r"(?i:duty|pwm)",
    ("per cent", "one per cent"): r"(?i:per_?cent|prozent|pct)|%",
}
_BY_ROLE = {
    "time": _TIME,
    "force": _FORCE,
    "measured_force": _FORCE,
    "position": _POSITION,
    "velocity": _VELOCITY,
    "acceleration": _ACCELERATION,
}


def base_unit(role: str, unit: str) -> tuple[str, float]:
    """Base unit and factor of a unit as it was written; of a velocity, that of the position.

    Parameters
    ----------
    role : {"time", "force", "measured_force", "position", "velocity", "acceleration"}
    unit : str
        For example "mm", "N m" or "µs".

    Raises
    ------
    InputError
        For a unit that is not one of the role's; the message lists them.
    """
    plain = _plain(unit)
    known = _BY_ROLE[role]
    if plain not in known:
        raise InputError(
            f"'{unit}' is no unit of {role}: use {', '.join(known)}{_CURES.get(role, '')}"
        )
    return known[plain]


def units_of(role: str) -> str:
    """The usual units of a role, in words."""
    usual = {"force": "[N], [Nm] or [A]", "position": "[m], [mm], [rad] or [deg]"}
    return usual.get(role) or ", ".join(f"[{unit}]" for unit in _BY_ROLE[role])


def is_unit(text: str) -> bool:
    """Whether a piece of a file is the name of a unit, of these roles or of something else."""
    plain = _plain(text)
    return plain in _FOREIGN.split() or any(plain in known for known in _BY_ROLE.values())


def is_of_another_role(role: str, unit: str) -> bool:
    """Whether a unit is known, and is none of this role's: m/s is no position's, V no role's."""
    plain = _plain(unit)
    return plain not in _BY_ROLE[role] and any(plain in known for known in _BY_ROLE.values())


def unit_by_name(role: str, name: str) -> str | None:
    """The base unit of what a name speaks of: ``theta`` is in rad; None where it does not say."""
    for unit, words in _BY_NAME[role].items():
        if re.search(words, re.split(r"[/.]", name)[-1], re.I):
            return unit
    return None


def unit_in_name(role: str, name: str) -> str | None:
    """The unit of a role that a name ends in: ``theta_deg``, ``speed_rad_s``; None without one."""
    return stem_and_unit(role, name)[1]


def stem_and_unit(role: str, name: str) -> tuple[str, str | None]:
    """A name without the unit of a role that it ends in, and that unit; all of it without one.

    One letter may be an index (``theta_m`` of a motor) and small letters a word: they hold where
    the name speaks of that unit, and one letter where it speaks of none.
    """
    known = _BY_ROLE.get(role, {})
    spelled = {unit.lower(): unit for unit in known}
    words = re.split(r"_|\s+(?=\S\S)", name)
    for count in (2, 1):  # m_s is m/s
        end, stem = "/".join(words[-count:]), "_".join(words[:-count])
        written = _plain(end)
        unit = written if written in known else spelled.get(written.lower())
        if unit is None or not (stem or len(written) > 2):
            continue
        quantity = {"measured_force": "force", "velocity": "position"}.get(role, role)
        spoken = unit_by_name(quantity, stem) if quantity in _BY_NAME else None
        exact = written in known and (len(written) > 1 or spoken is None)
        if exact or spoken == known[unit][0] or len(written) > 2:
            return stem, unit
    return name, None


def said_by_names(names: Mapping[str, str], units: Mapping[str, str | None]) -> tuple[Notice, ...]:
    """A note of which `units` the ends of `names` say, by their roles."""
    said = [role for role in names if units.get(role) == (unit_in_name(role, names[role]) or ...)]
    if not said:
        return ()
    text = ", ".join(f"the {role} '{names[role]}' in {units[role]}" for role in said)
    text = f"By its name is {text}. Say otherwise with --columns, as in {said[0]}=NAME[UNIT]."
    return (Notice("note", "units", text),)


def assumed_units(
    force_unit: str | None, position_unit: str | None, force_in: str, position_in: str
) -> tuple[Notice, ...]:
    """A note of what nobody said the unit of, and which one was taken (`choose_units`)."""
    said, taken = (force_unit, position_unit), {"force": force_in, "position": position_in}
    assumed = tuple(what for what, unit in zip(taken, said, strict=True) if unit is None)
    if not assumed:
        return ()
    text = (
        f"The {assumed[0]}'s unit is not given: it is taken to be in {taken[assumed[0]]}. Say "
        f"otherwise with --columns, as in {assumed[0]}=NAME[UNIT]."
    )
    if len(assumed) == 2:
        text = (
            f"No units were given: the force is taken to be in {force_in}, the position in "
            f"{position_in}. Say otherwise with --columns, as in position=q[mm]."
        )
    return (Notice("note", "units", text, assumed),)


def is_assumed(quantity: str, notices: Iterable[Notice]) -> bool:
    """Whether a note says that nobody said this quantity's unit, and which one was taken."""
    return any((n.level, n.topic) == ("note", "units") and quantity in n.about for n in notices)


def kind_by_names(force: str, position: str) -> str | None:
    """ "rotational" where one name speaks of a turn and none of a way; None otherwise."""
    said = {unit_by_name("force", force), unit_by_name("position", position)}
    return "rotational" if said & {"Nm", "rad"} and not said & {"N", "m"} else None


def says_drive(name: str) -> tuple[str, str] | None:
    """What a column's name says of an amplifier's input, and one unit of that; None of a force.

    Volts as in ``u_V``, ``volts``, ``DAC 0``, a duty cycle as in ``pwm``, or a share of what there
    is as in ``effort_percent``.
    """
    return next((said for said, words in _DRIVES.items() if re.search(words, name)), None)


def _plain(unit: str) -> str:
    """A unit without blanks and signs of multiplication, in ASCII."""
    plain = unit.strip().replace("\u00b5", "u").replace("\u03bc", "u").replace("\u00b0", "deg")
    for sign in (" ", "*", "\u00b7", "."):
        plain = plain.replace(sign, "")
    return _WRITTEN_OUT.get(plain.lower(), plain)


def refuse_mixed_units(force_unit: str, position_unit: str, where: str) -> None:
    """Refuse a force and a position that are not of one kind of motion.

    Raises
    ------
    InputError
        A stiffness would be in N/rad or N m/m, and masses in neither kg nor kg m^2.
    """
    if (force_unit, position_unit) in (("N", "rad"), ("Nm", "m")):
        raise InputError(
            f"{where}: the force is in {force_unit} and the position in {position_unit}; give both "
            "in N and m, or both in Nm and rad: correct the units, or turn one into the other by "
            "the lever arm R, as in force=NAME*R[Nm]",
            topic="units",
        )


def choose_units(
    force_unit: str | None,
    position_unit: str | None,
    kind: str | None,
    where: str,
) -> tuple[str, str]:
    """The units of force and position where one of them, or both, are not said.

    A position alone decides for N or Nm, a force in N or Nm alone for m or rad; otherwise the kind
    of device ("translational" or "rotational") decides, and without it N and m.

    Raises
    ------
    InputError
        For units that are not among the base units, or do not belong together, and for a kind that
        is none, or not theirs.
    """
    for unit, known, what in (
        (force_unit, FORCE_UNITS, "force_unit"),
        (position_unit, POSITION_UNITS, "position_unit"),
    ):
        if unit is not None and unit not in known:
            raise InputError(f"{where}: {what} is '{unit}'; use {', '.join(known)}")
    if kind not in (None, *KINDS):
        raise InputError(f"{where}: kind is {kind!r}; use {' or '.join(KINDS)}")
    if position_unit is None:
        rotational = {"N": False, "Nm": True}.get(force_unit or "", kind == "rotational")
        position_unit = "rad" if rotational else "m"
    if force_unit is None:
        force_unit = "Nm" if position_unit == "rad" else "N"
    refuse_mixed_units(force_unit, position_unit, where)
    of = kind_of(position_unit)
    if kind not in (None, of):
        other = "m" if of == "rotational" else "rad"
        raise InputError(
            f"{where}: {of} by its units (position in {position_unit}), but {kind} as it was "
            "declared, or as the device is; give the position's unit, as in "
            f"position=NAME[{other}]",
            topic="columns",
        )
    return force_unit, position_unit
