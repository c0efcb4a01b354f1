"""What tables are made of: text that needs no further formatting."""

from __future__ import annotations

from dataclasses import dataclass

Rows = tuple[tuple[str, ...], ...]
_DASH = "\N{EN DASH}"


@dataclass(frozen=True)
class ParameterRow:
    """One parameter: all numbers in the unit of the row.

    `reference` is the device file's value, a dash without one; `shrinkage` the posterior's width as
    a share of the prior's.
    """

    name: str
    title: str
    unit: str
    least_squares: str
    posterior: str
    range: str
    reference: str
    ess: str
    rhat: str
    remarks: str
    shrinkage: str = _DASH
