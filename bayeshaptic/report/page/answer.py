"""The first screen under the sentence: the interval, the model, what binds, how far to trust it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.quantities import estimate, percent
from bayeshaptic.report.headline import headline
from bayeshaptic.report.listed import listed
from bayeshaptic.report.numbers.hidden import in_short
from bayeshaptic.report.numbers.result import tip_limit
from bayeshaptic.report.numbers.unstated import unstated

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.report.numbers.rows import Rows

# How many per cent of 90 % intervals of K_CR held the truth of simulated recordings, and of how
# many, by the verdict. A test compares them with benchmarks/README.md.
FARED = {
    "consistent": (86, 200, "with nothing beside the model"),
    "explained": (89, 150, "with an effect of the library"),
    "unexplained": (94, 63, "with an effect that nothing promises to find"),
}
FARED_HIDDEN = (91, 799)  # the same, two in three with an effect of any size, most of them unseen
FARED_IN_LOOP = (
    "Read as a closed loop, through what the controller followed. How such intervals fared: of 45 "
    "simulated devices that nobody held, 38 of the 90 % intervals held the true limit, and 7 "
    "missed it by less than 0.03 dB."
)
FARED_THROUGHOUT = (
    "Read as a closed loop, through noise in the command that the motion does not make. "
    "How such intervals fared: of 82 simulated loops with such noise that had a stiffness, in "
    "whichever way they were read, 76 of the 90 % intervals held the true limit, and three lay "
    "above it, by less than 0.05 dB."
)
FARED_DIRECT = (
    "Read as a closed loop. How such intervals fared: of 227 simulated loops that were read so, "
    "206 of the 90 % intervals held the true limit, and four stiffnesses lay above it (by 0.01, "
    "0.07, 0.5 and 15 %)."
)


def facts(result: Result) -> Rows:
    """(what, value): the interval, the tip, what binds, the model, whom it speaks for."""
    analysis = result.analysis
    limit, tip = analysis.limit, tip_limit(analysis)
    if (reason := unstated(analysis)) is not None:
        told = ("Critical stiffness", f"none is stated: {reason}")
        if not analysis.sampled:
            return (told,)
        return (told, ("Model", _model(result)), ("Speaks for", _holder(analysis)))
    doubted = headline(result).status == "untrusted"
    name = "If the model were right" if doubted else "Critical stiffness"
    rows: list[tuple[str, ...]] = [(name, _interval(limit))]
    if tip is not None:
        rows.append(("At the tip", _interval(tip)))
    if analysis.hidden is not None:
        rows.append(("What could hide", in_short(analysis)))
    if doubted:  # a recommendation says it above
        rows.append(("What limits it", _binding(analysis)))
    rows.append(("Model", _model(result)))
    rows.append(("Speaks for", _holder(analysis)))
    return tuple(rows)


def fared(result: Result) -> str:
    """How such intervals did where the truth is known; empty where the loop was left open."""
    closed = result.closed
    if closed is None or closed.force is not None or headline(result).status == "untrusted":
        return ""
    if result.analysis.etfe.moved_throughout:
        return FARED_THROUGHOUT
    if result.analysis.etfe.through_reference:
        return FARED_IN_LOOP
    if result.analysis.etfe.direct:
        return FARED_DIRECT
    held, count, which = FARED[closed.verdict]
    if closed.verdict == "consistent" and result.analysis.hidden is not None:
        held, count = FARED_HIDDEN
        which = "(two in three with something beside the model, most of it too small to be seen)"
    return (
        f"How such intervals fared: of {count} simulated recordings {which}, "
        f"{held} % of the 90 % intervals held the true limit."
    )


def _interval(limit: Any) -> str:
    low, middle, high = (limit.quantile(p) for p in (0.05, 0.5, 0.95))
    if not all(math.isfinite(value) for value in (low, middle, high)):
        return "none: stable with any stiffness" if low == math.inf else "not bounded above"
    text = f"{estimate(middle, low, high, limit.unit)}, median and 90 % interval"
    if low <= 0:
        return text
    level, *ends = (f"{limit.db(p):.1f}" for p in (0.5, 0.05, 0.95))
    around = "" if {level} == set(ends) else f" ({' to '.join(ends)})"
    return f"{text}; {level}{around} dB"


def _binding(analysis: Analysis) -> str:
    worth_naming = 0.001
    likely = [c for c in analysis.limit.crossings if c.probability >= worth_naming]
    if not likely:
        return "nothing"
    alone = len(likely) == 1
    return ", or ".join(
        c.label if alone else f"{c.label} ({percent(c.probability)})" for c in likely
    )


def _model(result: Result) -> str:
    analysis, closed = result.analysis, result.closed
    structure = analysis.model.structure
    text = f"{structure.name}: {structure.title.partition(', equation')[0]}"
    added = [] if closed is None else [e.title for e in closed.effects if e.family != "measurement"]
    if added:
        text += f"; with {listed(added)}"
    return text


def _holder(analysis: Analysis) -> str:
    recording = analysis.recording
    user = None if recording is None else recording.user
    place = None if recording is None else recording.configuration
    where = "" if place is None else f", configuration {place}"
    if analysis.model.held:
        return f"{f'the grip of {user}' if user else 'the grip'} in this recording{where}"
    if user:
        return f"the device as {user} held it in this recording{where}"
    return f"the device with nobody holding it{where}"


def caption(result: Result) -> str:
    """Under the bar of all estimates."""
    line = ", the vertical line is the stiffness of the sentence above"
    line = line if headline(result).stiffness is not None else ""
    return (
        f"Every estimate of the limit on one axis: bars are 90 % intervals{line}. The rules hold "
        "for rigid devices only, and nobody knows how far they are off for others."
    )
