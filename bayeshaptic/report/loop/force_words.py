"""What inverse dynamics says of a recording with feedback: sentences and rows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.diagnosis.feedback.tones_in_motion import tones_of
from bayeshaptic.diagnosis.samples.sinusoids import in_words
from bayeshaptic.inference.time_domain.mass_in_loop import NAMES
from bayeshaptic.quantities import NOTHING, pure, quantity, scale
from bayeshaptic.report.loop.motion_words import motion_words

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.diagnosis.feedback.explain import ForceExplained
    from bayeshaptic.diagnosis.feedback.inverse_dynamics import InverseDynamics
    from bayeshaptic.report.numbers.rows import Rows


def found(force: ForceExplained, unit: str, response: str) -> str:
    """One paragraph: what the motion explains of the force, and with which terms.

    `response` says why nothing is read from that.
    """
    linear, *added = force.further.steps
    why = (
        f"{response} The equation of motion holds in spite of that: below "
        f"{quantity(force.further.cutoff_hz, 'Hz')}, a mass with a damper and a constant force "
        f"leaves {quantity(linear.held_out_rms, unit)} rms of the force unexplained"
    )
    if not added:
        return f"{why}, and no further term lowers that."
    first = titles(force.further)[added[0].term]
    text = f"{why}. The model lacked {first}: it cuts that to "
    text += quantity(added[0].held_out_rms, unit)
    if len(added) > 1:
        text += (
            f"; {len(added) - 1} more term{'s' if len(added) > 2 else ''} to "
            f"{quantity(added[-1].held_out_rms, unit)}"
        )
    return f"{text}. Each error is that of one half of the recording with the other half's numbers."


def in_short(force: ForceExplained, unit: str) -> str:
    """One sentence for the top of the page and the command line."""
    linear, *added = force.further.steps
    before = quantity(linear.held_out_rms, unit)
    if not added:
        return f"One mass with a damper explains the force but for {before} rms."
    first = titles(force.further)[added[0].term]
    return (
        f"One mass with a damper explains the force but for {before} rms. With {first} beside it, "
        f"{quantity(added[0].held_out_rms, unit)} rms is left."
    )


def titles(found: InverseDynamics) -> dict[str, str]:
    """What each term is, by its name."""
    return {term.name: term.title for term in found.terms}


def steps(force: ForceExplained, unit: str) -> Rows:
    """A row a term, in the order in which they were added: (what was added, error)."""
    named = titles(force.further)
    start = ", ".join(term.title for term in force.further.terms[:3])
    return tuple(
        (named.get(step.term, start), quantity(step.held_out_rms, unit))
        for step in force.further.steps
    )


def fits(force: ForceExplained) -> dict[str, InverseDynamics]:
    """The equations of motion with terms beyond mass and damper, by what they have; none alike."""
    added = len(force.further.steps) - 1
    if not added:
        return {}
    if added == 1:
        return {"with the term added": force.further}
    return {"with the first term": force.first, "with all terms": force.further}


def coefficient_heads(force: ForceExplained) -> tuple[str, ...]:
    """The columns of `coefficients`."""
    return "", *(fits(force) or ("estimate",))


def coefficients(force: ForceExplained) -> Rows:
    """A row a coefficient: (what it is, its value in each of `fits`)."""
    columns = tuple(fits(force).values()) or (force.further,)
    return tuple(
        (
            term.title,
            *(
                _value(one, term.name, term.unit) if term.name in titles(one) else NOTHING
                for one in columns
            ),
        )
        for term in force.further.terms
    )


def remains(force: ForceExplained, analysis: Analysis) -> str:
    """What is left of the force, all of it fitted."""
    limit = (
        "No limit follows from this: for a critical stiffness, record with an external excitation."
        if analysis.in_loop is None
        else f"{motion_words(analysis).told} do not rest on these numbers, but on the motion."
    )
    first, further = (pure(100 * f.relative_error, 3) for f in (force.first, force.further))
    if len(fits(force)) < 2:
        return f"What is left is {further} % of the force. {limit}"
    return (
        f"What is left is {first} % of the force with the first term and {further} % with all of "
        "them. The terms beyond the first describe this recording and are no law, and with them a "
        f"coefficient means something else than without. {limit}"
    )


def motion(analysis: Analysis) -> str:
    """How near the simulated motion is to the measured one, and what was fitted with it."""
    found, recording = analysis.in_loop, analysis.recording
    assert found is not None
    assert recording is not None
    unit, force = recording.position_unit, recording.force_unit
    way = quantity(float(np.ptp(recording.position)), unit)
    text = (
        "One mass with viscous and dry friction, a constant force and a delay, simulated "
        f"{motion_words(analysis).beside}, stays within "
        f"{quantity(found.motion.error_rms, unit)} rms of the measured motion over {way}."
    )
    for law in found.laws:
        text += (
            f" The motion called for {law.effect.title} (t = {pure(law.score.t, 3)}), which joined "
            f"it and leaves {pure(100 * law.score.left, 2)} % of the error's power that was there."
        )
    if tones := tones_of(found.motion):
        text += f" Tones were fitted with it, as forces on the mass: {in_words(tones, force)}."
    rms = float(np.sqrt(np.mean(np.square(recording.force))))
    worth_naming = 1e-4  # of the force
    if (disturbed := found.motion.disturbed) is not None:
        text += (
            f" What is left looks like a white force of {quantity(disturbed.force_sd, force)} rms "
            f"and noise of {quantity(disturbed.position_sd, unit)} rms in the position; each "
            "sample counts for what those before it leave open of it."
        )
    elif found.motion.uneven_rms > worth_naming * rms:
        text += (
            " A force that changes along the way and with the direction, "
            f"{quantity(found.motion.uneven_rms, force)} rms, was fitted with it: dry "
            "friction and constant force are the means over the motion."
        )
    if not found.halves:
        return text
    return (
        f"{text} Each half of the recording was then simulated with the values of the other. "
        f"The power of its error is {_times(found.held_out)}, and "
        f"{pure(100 * found.covered, 2)} % of the samples lie in the 90 % band."
    )


def _times(ratio: float) -> str:
    """How large an error is with the other half's values."""
    if abs(ratio - 1) < 0.005:
        return "the same as with its own"
    return f"{pure(ratio, 3)} times that with its own"


def halves(analysis: Analysis) -> Rows:
    """A row a parameter: (what it is, whole recording, first half, second half)."""
    rows, found = [], analysis.in_loop
    assert found is not None
    for index, name in enumerate(NAMES):
        if name not in analysis.model.names:
            continue
        fits = (found.motion, *found.halves)
        first = fits[0]
        row = scale((float(first.values[index]), float(first.sd[index])), analysis.model.unit(name))
        cells = []
        for fit in fits:
            value, sd = float(fit.values[index]), float(fit.sd[index])
            cells.append(f"{row.with_error(value, sd)} {row.unit}".rstrip())
        rows.append((analysis.model.parameter(name).title, *cells))
    return tuple(rows)


def _value(found: InverseDynamics, name: str, unit: str) -> str:
    value, sd = found[name]
    row = scale((value, sd), unit)
    return f"{row.with_error(value, sd)} {row.unit}".rstrip()
