"""The force that the linear model leaves over, drawn over the motion: what convinces a person."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.quantities import scale
from bayeshaptic.recordings.response.etfe import RandomSpectra
from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.diagnosis.residuals.force_curve import ForceCurve
    from bayeshaptic.diagnosis.residuals.residual import Test

_TITLES = {
    "velocity": "velocity",
    "load velocity": "velocity of\nthe load",
    "position": "position",
    "stretch": "stretch",
    "stretch velocity": "velocity of\nthe stretch",
    "command": "command",
    "damping along the way": "at the usual speed:\nposition",
}
_BEFORE: dict[str, Any] = {
    "color": style.OTHER,
    "fmt": "s--",
    "markerfacecolor": "white",
    "label": "before: left over by the model as declared",
}
_FORCE: dict[str, Any] = {
    "color": style.DATA,
    "fmt": "^:",
    "label": "the force found: what the new linear part leaves over",
}
_AFTER: dict[str, Any] = {"color": style.MODEL, "fmt": "o-", "label": "after: left over with it"}


def is_shown(closed: Closed) -> bool:
    """Where a nonlinear force was found, or is suspected, in a recording that can show it."""
    etfe = closed.base.etfe
    if etfe.recording is None or not isinstance(etfe.spectra, RandomSpectra):
        return False
    tests = (*closed.traced.before, *closed.traced.after)
    return any(e.family == "nonlinear" for e in closed.effects) or any(
        test.flagged and test.family == "nonlinear" for test in tests
    )


def draw(closed: Closed) -> Figure:
    """A panel for each motion, one unit of force for all."""
    curves = _curves(closed)
    unit = closed.base.etfe.force_unit
    highest = max(float(np.median(np.abs(c.force))) for row in curves.values() for c, _ in row)
    force = scale(highest, unit)
    figure = style.new_figure(3.1)
    panels = figure.subplots(1, len(curves), sharey=True, squeeze=False)[0]
    for axes, (over, row) in zip(panels, curves.items(), strict=True):
        _panel(axes, closed, over, row, force.factor, steps=4 if len(curves) < 5 else 2)
    panels[0].set_ylabel(f"force, {force.unit}", fontsize=style.FONT)
    handles, _ = panels[0].get_legend_handles_labels()
    style.shared_legend(figure, handles, "upper left", 1)
    return figure


def _curves(closed: Closed) -> dict[str, list[tuple[ForceCurve, dict[str, Any]]]]:
    from bayeshaptic.diagnosis.residuals.columns import motions
    from bayeshaptic.diagnosis.residuals.force_curve import force_curve
    from bayeshaptic.effects.nonlinear.shapes import ALONG, COMMAND, STRETCH_VELOCITY, VELOCITY

    base, analysis = closed.base, closed.analysis
    assert base.recording is not None
    found = {}
    nonlinear = any(effect.family == "nonlinear" for effect in closed.effects)
    same = analysis.etfe.recording is not None and (
        analysis.etfe.recording.samples == base.recording.samples
    )
    known = motions(base.fit, base.recording)
    for over, motion in known.items():
        if over == COMMAND and over not in _raised(closed.traced.after):
            continue  # only where it is still in question
        if over in (ALONG, STRETCH_VELOCITY) and over not in _raised(closed.traced.before):
            continue
        times = known[VELOCITY] / known[VELOCITY].std() if over == ALONG else 1.0
        row = [(force_curve(base.fit, base.etfe, over, motion, times), _BEFORE)]
        if nonlinear and same:
            row.append((force_curve(analysis.fit, base.etfe, over, motion, times), _FORCE))
        if closed.effects and same:
            row.append((force_curve(analysis.fit, analysis.etfe, over, motion, times), _AFTER))
        found[over] = row
    return found


def _raised(tests: Sequence[Test]) -> set[str]:
    """What the tests that are flagged are over."""
    from bayeshaptic.effects.laws import variables

    return variables(test.name for test in tests if test.flagged)


def _panel(
    axes: Axes,
    closed: Closed,
    over: str,
    row: list[tuple[ForceCurve, dict[str, Any]]],
    factor: float,
    steps: int,
) -> None:
    from matplotlib.ticker import MaxNLocator

    etfe = closed.base.etfe
    unit = etfe.position_unit + ("/s" if over.endswith("velocity") else "")
    unit = etfe.force_unit if over == "command" else unit
    motion = scale(float(np.abs(row[0][0].motion).max()), unit)
    style.panel(axes, f"{_TITLES[over]}, {motion.unit}")
    # Numbers of a stretch are long.
    axes.xaxis.set_major_locator(MaxNLocator(steps, symmetric=True))
    axes.axhline(0, color=style.PRIOR, linewidth=0.7)
    vague = 6.0  # times the usual error of a curve: such a point would only hide the others
    for curve, look in row:
        clear = curve.sd <= vague * np.median(curve.sd)
        bars = axes.errorbar(
            curve.motion[clear] * motion.factor,
            curve.force[clear] * factor,
            yerr=2 * curve.sd[clear] * factor,
            markersize=3.5,
            linewidth=1.0,
            elinewidth=0.7,
            capsize=1.5,
            **look,
        )
        if look is not _FORCE and len(row) > 1:
            style.layer(bars.get_children(), "before" if look is _BEFORE else "after")
