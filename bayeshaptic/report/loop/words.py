"""What closing the loop found, in sentences."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from bayeshaptic.diagnosis.traced import CONSISTENT, UNEXPLAINED
from bayeshaptic.effects.library import effect_class
from bayeshaptic.quantities import pretty_unit, pure, scale
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.feedback import is_certain
from bayeshaptic.report.listed import listed
from bayeshaptic.report.loop import force_words
from bayeshaptic.report.loop.change_words import error_change, limit_change, moved, noise_change
from bayeshaptic.report.loop.motion_words import determined
from bayeshaptic.report.loop.unexplained import remainder, worst
from bayeshaptic.report.numbers.hidden import likely, moves
from bayeshaptic.report.numbers.misfit import misfit_factor, misfit_is_clear

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.closed import Closed
    from bayeshaptic.diagnosis.state import Accepted

_OVER = "_last_over_first"
_WORST = "worst_part"  # the evidence says which
# Titles with one of these words take no article.
_UNCOUNTABLE = {"backlash", "cogging", "damping", "delay", "drag", "friction", "gravity", "jitter"}
_UNCOUNTABLE |= {"quantisation", "stiffness"}
_PLURAL = {"rows", "samples", "saturation", "steps"}


def verdict(closed: Closed) -> tuple[str, ...]:
    """The paragraphs that open the section: what was found, and what it did."""
    if closed.verdict == CONSISTENT:
        return (_nothing(closed),)
    found = (lacked(closed),) if closed.effects else ()
    if closed.verdict == UNEXPLAINED:
        return (*found, *remainder(closed))
    return (*found, _rest(closed))


def _rest(closed: Closed) -> str:
    """What is left where no test is beyond its threshold."""
    analysis = closed.analysis
    if misfit_is_clear(analysis):
        return (
            "No test finds anything more, and yet what is left is "
            f"{misfit_factor(analysis)} times the noise: the model does not explain this recording."
        )
    widened = [
        new
        for old in closed.traced.before
        for new in closed.traced.after
        if new.name == old.name and new.statistic > old.threshold
    ]
    if not widened:
        return "What is left is noise: no test finds anything more."
    top = max(widened, key=lambda test: test.statistic)
    return (
        "What is left is as much as the fitted law may be wrong by, and no more: the largest of it "
        f"({top.text}) is within its threshold of {pure(top.threshold, 2)} after the law was taken "
        "off."
    )


def lacked(closed: Closed) -> str:
    """What was added and what it changed, in one paragraph."""
    measured, added = _measured_and_added(closed)
    parts = []
    for what, effects in (("the recording has", measured), ("the model lacked", added)):
        named = [f"{_with_article(e.title)}{_numbers(closed, e)}" for e in effects]
        parts += [f"{what} {listed(named)}"] if named else []
    text = "; ".join(parts)
    count = sum(_count(effect) for effect in added)
    size = f" ({count} parameter{'' if count == 1 else 's'})" if count else ""
    adding = f"adding {'it' if len(added) == 1 else 'them'}{size}"
    taking = "mending that" if _is_mended(closed) else "taking that for noise"
    doing = " and ".join(([taking] if measured else []) + ([adding] if added else []))
    return (
        f"{text[0].upper()}{text[1:]}; {doing} {error_change(closed)}{noise_change(closed)}; "
        f"{limit_change(closed)}."
    )


def in_short(closed: Closed) -> str:
    """One sentence for the top of the page."""
    if told_too_little(closed.analysis.notices):
        return determined(closed.analysis)
    if closed.force is not None:
        return force_words.in_short(closed.force, closed.base.etfe.force_unit)
    if is_certain(closed.analysis.notices) and not closed.effects:
        return "Nothing was looked for in the response, because feedback biases it."
    if closed.verdict == CONSISTENT:
        if misfit_is_clear(closed.analysis):
            return ""
        hiding = likely(closed.analysis)
        but = ""
        if hiding is not None:
            does = f"and allowed for: {moves(hiding)} of the limit"
            but = f"; {_with_article(hiding.title)} is likely all the same ({does})"
        return f"The model as declared explains the recording to within its noise{but}."
    if not closed.effects:
        return ""
    measured, added = (
        listed(_with_article(effect.title) for effect in effects)
        for effects in _measured_and_added(closed)
    )
    found = []
    if measured:
        taken = "is mended" if _is_mended(closed) else "is taken for noise"
        found.append(f"The recording has {measured}; here that {taken}.")
    if added:
        here = "it is" if len(_measured_and_added(closed)[1]) == 1 else "they are"
        found.append(f"The model as declared lacked {added}; here {here} in the model.")
    return f"{' '.join(found)} {moved(closed)}."


def _measured_and_added(closed: Closed) -> tuple[list[Accepted], list[Accepted]]:
    """What was found in the measurement, and in the device."""
    measured = [effect for effect in closed.effects if effect.family == "measurement"]
    return measured, [effect for effect in closed.effects if effect not in measured]


def _is_mended(closed: Closed) -> bool:
    """Whether something found in the measurement was put right, and does not stay as noise."""
    return any(effect_class(effect.name).mended for effect in _measured_and_added(closed)[0])


def subject(closed: Closed) -> str:
    """What the numbers of a page are of, where something was found."""
    mended, added = _is_mended(closed), _measured_and_added(closed)[1]
    if not added:
        return "the recording with what was found" + (" mended" if mended else " taken for noise")
    return f"the model with what was found{' in the mended recording' if mended else ''}"


def names(closed: Closed) -> str:
    """The titles of what was found."""
    return listed(effect.title for effect in closed.effects)


def scope(closed: Closed) -> str:
    """What else is different in the rest of the page."""
    families = {effect.family for effect in closed.effects}
    found = []
    if "nonlinear" in families or _is_mended(closed):
        found.append("the measured response is drawn without what these add to it")
    if "time-varying" in families:
        found.append("of what changes over time, the worst part or state counts")
    return "".join(f"; {text}" for text in found)


def force_caption(closed: Closed) -> str:
    """Under the curves of the force."""
    if any(effect.family == "nonlinear" for effect in closed.effects):
        return (
            "Force that the linear model leaves over, with error bars of two standard deviations. "
            "Before, the fit hides as much of it as it can in dampers and springs; the triangles "
            "show all of it; after, nothing but noise should be left."
        )
    return (
        "Force that the model leaves over, with error bars of two standard deviations; a "
        "horizontal line at zero would be noise."
    )


def parameter_words(name: str) -> str:
    """What an estimate that is no parameter of the model is, from its name."""
    if name.endswith(_OVER):
        return f"{name.removesuffix(_OVER)}, last part of the recording over the first"
    return " ".join(word for word in name.split("_") if word not in ("hz", "s"))


def shown_estimates(effect: Accepted) -> tuple[str, ...]:
    """Names of the numbers beside the posterior that say something by themselves."""
    return tuple(name for name in effect.estimates if name != _WORST)


def plus_minus(mean: float, sd: float | None, unit: str) -> str:
    """A number with its error and unit: ``"0.590 ± 0.020 N"``."""
    row = scale(mean, unit)
    return f"{row.with_error(mean, sd)} {row.unit}".rstrip()


def _nothing(closed: Closed) -> str:
    tests = closed.traced.before
    top = worst(tests)
    nearest = "" if top is None else f" The nearest to its threshold: {top.text}."
    return (
        f"Nothing to find: {len(tests)} tests of the residual were made, and none found more than "
        f"noise would give.{nearest} Nothing was added to the model."
    )


def _count(effect: Accepted) -> int:
    """Numbers that an effect adds; none are named where whole groups vary over time."""
    if effect.family == "time-varying":
        return 0
    return len(effect.parameters) + len(effect.estimates)


def _numbers(closed: Closed, effect: Accepted) -> str:
    """The effect's parameters in brackets; of a drift the one that changed most."""
    posterior = closed.analysis.stated.summary()
    model = closed.analysis.model
    shown = [
        f"{model.parameter(name).title} {plus_minus(found['mean'], found['sd'], found['unit'])}"
        for name in effect.parameters
        if (found := posterior.get(name)) is not None
    ]
    changed = {
        name: value.mean
        for name, value in effect.estimates.items()
        if name.endswith(_OVER) and value.mean > 0
    }
    if changed:
        most = max(changed, key=lambda name: abs(math.log(changed[name])))
        shown.append(f"{most.removesuffix(_OVER)} ends at {pure(changed[most])} times its start")
    else:
        shown += [
            f"{parameter_words(name)} {plus_minus(value.mean, value.sd, value.unit)}"
            for name, value in effect.estimates.items()
            if name in shown_estimates(effect)
        ]
    most_numbers = 3
    return f" ({', '.join(shown[:most_numbers])})" if shown else ""


def _with_article(title: str) -> str:
    words = {word.strip("():") for word in pretty_unit(title).lower().split()}
    if title.startswith(("a ", "an ", "the ")) or words & (_UNCOUNTABLE | _PLURAL):
        return title
    return f"{'an' if title[0].lower() in 'aeiou' else 'a'} {title}"
