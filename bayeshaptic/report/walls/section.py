"""The section about stable walls: for one recording, or for all cases of a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures.walls import curve as limits_curve, kb as limits_kb
from bayeshaptic.report.numbers.rules import least_damped
from bayeshaptic.report.page.section import Section, section
from bayeshaptic.report.walls.words import rule_rows, width_rows, words
from bayeshaptic.stability.cases import FREE, HELD, Case, DeviceLimit
from bayeshaptic.stability.walls.limit_table import LimitTable, limit_table

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

FIGURES = ("limits_curve", "limits_kb")
DRAWS = 2400
_FRICTION = "friction_force"
_IN_LOOP = "coulomb"  # the same, as a parameter of the motion under feedback


def limits_section(
    table: LimitTable,
    friction: float | None = None,
    resolution: float | None = None,
) -> Section:
    """HTML and pictures: P(stable | K), P(stable | K, B), Z-width, rules.

    Parameters
    ----------
    table : LimitTable
        Of one case or several.
    friction, resolution : float, optional
        Coulomb friction and one encoder count, for Abbott and Okamura's rule.
    """
    rules = least_damped(table.cases, friction, resolution)
    figures = {
        "limits_curve": (limits_curve.draw(table), "Probability of being stable over stiffness"),
        "limits_kb": (limits_kb.draw(table, rules), "Stable walls by stiffness and damping"),
    }
    return section(
        "limits.jinja",
        figures,
        words=words(table, rules),
        widths=width_rows(table),
        rules=rule_rows(table, rules),
    )


def table_of(
    cases: Sequence[Case], draws: int = DRAWS, limit: DeviceLimit | None = None
) -> LimitTable:
    """The limits over some cases, with fewer draws where a model takes long to look at.

    `limit` is that of all cases together, where it is known.
    """
    slow = any(case.model.system(case.draws[:1]).dynamic_links for case in cases)
    slow_draws = 2000  # of a model without a finite set of poles
    return limit_table(cases, draws=min(draws, slow_draws) if slow else draws, limit=limit)


def case_of(result: Result) -> Case:
    """An analysis, or what closing the loop returns, as a case by itself."""
    analysis = result.analysis
    held = analysis.model.held
    user = None if analysis.recording is None else analysis.recording.user
    label = f"held by {user}" if user else "held" if held else "nobody holds it"
    chains = np.swapaxes(analysis.posterior.chains, 1, 2)  # the order of the limit's samples
    draws = chains.reshape(-1, chains.shape[-1])
    return Case(label, HELD if held else FREE, analysis.model, draws, analysis.limit)


def friction_of(result: Result) -> float | None:
    """The Coulomb friction that closing the loop found, or None."""
    closed, posterior = result.closed, result.analysis.posterior
    if _IN_LOOP in posterior.model.names:
        return float(np.median(posterior.draws[:, posterior.model.names.index(_IN_LOOP)]))
    for effect in () if closed is None else closed.effects:
        if _FRICTION in effect.estimates:
            return float(effect.estimates[_FRICTION].mean)
    return None


def resolution_of(analysis: Analysis) -> float | None:
    """One encoder count, from the recording or the device file."""
    for source in (analysis.recording, analysis.device):
        found = getattr(source, "encoder_resolution", None)
        if found:
            return float(found)
    return None
