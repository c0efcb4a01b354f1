"""Limits known from elsewhere (a relay experiment, a paper), to be drawn beside a study's own."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bayeshaptic.devices.table import Table
from bayeshaptic.errors import InputError

REFERENCE_KEYS = ("label", "held", "critical_stiffness", "critical_stiffness_db")


@dataclass(frozen=True)
class KnownLimit:
    """Critical stiffnesses that somebody else found; they take no part in any analysis.

    Attributes
    ----------
    label : str
        Where they are from.
    held : bool
        Whether somebody held the device.
    critical_stiffness : tuple of float
        In the unit of the study's stiffness.
    """

    label: str
    held: bool
    critical_stiffness: tuple[float, ...]


def read_references(content: object, path: object) -> tuple[KnownLimit, ...]:
    """The ``[[reference]]`` tables of a study.

    Raises
    ------
    InputError
        For unknown keys, wrong types, and values that are not above zero.
    """
    if not isinstance(content, list):
        raise InputError(f"{path}: write references as [[reference]] tables")
    return tuple(
        _reference(table, f"{path}, reference {number}") for number, table in enumerate(content, 1)
    )


def _reference(content: object, where: str) -> KnownLimit:
    table = Table(content, where, known=REFERENCE_KEYS)
    label = table.text("label")
    if label is None:
        raise InputError(f"{where} needs a label that says where its values are from")
    held = table.content.get("held", True)
    if not isinstance(held, bool):
        raise table.wrong("held", "true or false")
    given = [key for key in REFERENCE_KEYS[2:] if key in table.content]
    if len(given) != 1:
        raise InputError(
            f"{where} needs critical_stiffness or critical_stiffness_db (20 log10 of it), one of "
            "the two"
        )
    values = _numbers(table, given[0])
    if given[0].endswith("_db"):
        values = tuple(10 ** (value / 20) for value in values)
    if not all(value > 0 for value in values):
        raise table.wrong(given[0], "stiffnesses above zero")
    return KnownLimit(label, held, values)


def _numbers(table: Table, key: str) -> tuple[float, ...]:
    values = table.content[key]
    values = values if isinstance(values, list) else [values]
    usable = all(isinstance(v, int | float) and not isinstance(v, bool) for v in values)
    if not values or not usable or not all(math.isfinite(v) for v in values):
        raise table.wrong(key, "a list of numbers")
    return tuple(float(v) for v in values)
