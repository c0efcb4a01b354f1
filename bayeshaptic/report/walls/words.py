"""Sentences and rows about the walls that are stable."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from bayeshaptic.quantities import (
    NOTHING,
    Scale,
    percent,
    percents,
    pure,
    quantity,
    rounded_down,
    scale,
)
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.estimates import HEADLINE_RISKS
from bayeshaptic.stability.tail import quantiles

if TYPE_CHECKING:
    from bayeshaptic.report.numbers.rules import Rules
    from bayeshaptic.stability.walls.filter_limits import FilterLimits
    from bayeshaptic.stability.walls.limit_table import LimitTable
    from bayeshaptic.stability.walls.width import ZWidth

_DAMPING = (
    "Damping B acts on a velocity that the controller makes from the positions it reads. Up to a "
    "point it makes a stiffer wall stable; beyond it the delay of that velocity makes the loop "
    "unstable by itself. The boundary is computed in closed form for every draw of the posterior, "
    "all vibration modes included. It is that of the linear loop: one encoder count within one "
    "period is a velocity of Δ/T, which a large B turns into a force that a hand feels long before "
    "the boundary."
)


@dataclass(frozen=True)
class WallWords:
    """What `limits.jinja` says."""

    lead: tuple[str, ...]
    damping: str
    curve_caption: str
    kb_caption: str
    area_unit: str
    held: str
    rules: str


def words(table: LimitTable, rules: Rules) -> WallWords:
    """The sentences of the section."""
    return WallWords(
        _lead(table),
        _DAMPING,
        _curve_caption(table),
        _kb_caption(table, rules),
        _area(table).unit,
        ", the hand included" if any(case.model.held for case in table.cases) else "",
        _rules(rules),
    )


def width_rows(table: LimitTable) -> tuple[tuple[str, ...], ...]:
    """Each filter at each risk: filter, risk, stiffest wall, its damping, largest damping, area.

    Risks that are one row to the digits shown are said once.
    """
    area = _area(table)
    rows = []
    for part in table.filters:
        shown: dict[tuple[str, ...], list[float]] = {}
        for risk, undamped in zip(table.risks, table.stiffness, strict=True):
            width = part.width(risk)
            why = "too few draws to say" if undamped is None else "too few draws over damping"
            row: tuple[str, ...] = (why, *(3 * (NOTHING,)))
            if width is not None:
                row = (
                    quantity(width.stiffness, table.unit),
                    quantity(width.at_damping, table.damping_unit),
                    quantity(width.damping, table.damping_unit),
                    pure(width.area * area.factor),
                )
            shown.setdefault(row, []).append(risk)
        rows += [(part.kind.label, percents(risks), *row) for row, risks in shown.items()]
    return tuple(rows)


def rule_rows(table: LimitTable, rules: Rules) -> tuple[tuple[str, ...], ...]:
    """The rules at no damping: name, stiffness, what it says."""
    rigid, passive = (float(rule()) for rule in (rules.rigid, rules.passive))
    rows = [
        (
            "(b + B)/(T/2 + td)",
            quantity(rigid, table.unit),
            "stability of a rigid device: Díaz and Gil (2010), equation (19); with damping Gil et "
            "al. (2009), for small B only",
        ),
        (
            "b > K T/2 + |B|",
            quantity(passive, table.unit),
            "passivity of a rigid device without delay: Colgate and Schenkel (1997)",
        ),
    ]
    if rules.quantised is not None:
        rows.append(
            (
                "K ≤ min(2b/T, 2fc/Δ)",
                quantity(rules.quantised, table.unit),
                "passivity with Coulomb friction and a coarse encoder: Abbott and Okamura (2005)",
            )
        )
    return tuple(rows)


def _lead(table: LimitTable) -> tuple[str, ...]:
    risk, stiffness = _told(table)
    if risk is None or stiffness is None:
        return ("The draws are too few to state a stiffness at a small risk.",)
    where = "" if len(table.cases) == 1 else f" in all {len(table.cases)} cases"
    if stiffness == math.inf:
        return (f"Any wall is stable with a probability of {percent(1 - risk)}.",)
    low, high = (float(end) for end in quantiles(table.samples, (0.05, 0.95)))
    first = (
        f"A wall without damping is stable{where} with a probability of {percent(1 - risk)} up to "
        f"{rounded_down(stiffness, table.unit, low, high).text}."
    )
    told = [(part, part.width(risk)) for part in table.filters]
    parts = [_gain(part, width, stiffness, table) for part, width in told if width is not None]
    if not parts:
        return (first,)
    return first, f"With damping, at the same risk: {'; '.join(parts)}."


def _gain(part: FilterLimits, width: ZWidth, stiffness: float, table: LimitTable) -> str:
    how = (
        "velocity by the backward difference"
        if part.kind.cutoff_hz is None
        else f"velocity behind a low-pass at {quantity(part.kind.cutoff_hz, 'Hz')}"
    )
    edge = 1.1  # a damping that raises the limit by less is not worth a word
    if width.stiffness < edge * stiffness:
        return f"{how}, damping gains nothing worth having"
    return (
        f"{how}, up to {quantity(width.stiffness, table.unit)} with "
        f"{quantity(width.at_damping, table.damping_unit)}"
    )


def _told(table: LimitTable) -> tuple[float | None, float | None]:
    for risk in HEADLINE_RISKS:
        if risk in table.risks:
            stiffness = table.stiffness[table.risks.index(risk)]
            if stiffness is not None:
                return risk, stiffness
    return None, None


def _curve_caption(table: LimitTable) -> str:
    which = (
        ""
        if len(table.cases) == 1
        else " The thick line is for all cases together, each draw with its lowest limit."
    )
    return (
        "Without damping. Left: the probability that a wall of this stiffness is stable. Right: "
        f"the risk that it is not, down to 0.05 %; dots are the stiffnesses in limits.json.{which}"
    )


def _kb_caption(table: LimitTable, rules: Rules) -> str:
    which = "" if len(table.cases) == 1 else f" (drawn for: {rules.label})"
    return (
        "Walls by damping and stiffness: the darker, the more probable is stability; a sharp edge "
        "is a posterior that leaves little doubt. Lines: the risks of limits.csv, and the rules "
        f"for rigid devices{which}, which know neither the vibration modes nor the filter."
    )


def _rules(rules: Rules) -> str:
    if rules.quantised is not None:
        return ""
    missing = [
        name
        for name, value in (
            ("the Coulomb friction", rules.friction),
            ("the encoder's resolution", rules.resolution),
        )
        if value is None
    ]
    return (
        "Abbott and Okamura's rule for coarse encoders, K ≤ min(2b/T, 2fc/Δ), is left out: "
        f"{listed(missing)} {'is' if len(missing) == 1 else 'are'} not known here."
    )


def _area(table: LimitTable) -> Scale:
    """How areas of the K-B plane are written: both units with the prefixes of the largest width."""
    widths = [part.width(risk) for part in table.filters for risk in table.risks]
    known = [width for width in widths if width is not None]
    k = scale([width.stiffness for width in known], table.unit)
    b = scale([width.damping for width in known], table.damping_unit)
    return Scale(k.factor * b.factor, f"({k.unit})({b.unit})")
