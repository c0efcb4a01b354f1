"""Sentences and rows about where the uncertainty comes from, and what to change or measure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bayeshaptic.quantities import minus, percent, pure, quantity
from bayeshaptic.report.figures.style import short
from bayeshaptic.report.listed import listed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bayeshaptic.inference.next_experiment import Experiment
    from bayeshaptic.stability.guidance.elasticities import Elasticities
    from bayeshaptic.stability.guidance.guidance import Guidance
    from bayeshaptic.stability.guidance.shares import Share, VarianceShares
    from bayeshaptic.stability.guidance.sweep import Sweep

_DB = 20 / np.log(10)
_NAMED = 0.05  # shares that a sentence names
_HARDLY = 0.9  # of the width: a further recording that leaves more is not worth making
_FLAT = 0.02  # relative change that is none
_DOUBT = "Doubt about the model: the error of what was found, what could hide, what is unexplained."


@dataclass(frozen=True)
class GuidanceWords:
    """What `guidance.jinja` says."""

    lead: str
    overlap: str
    raise_it: str
    sweeps: tuple[str, ...]
    next: str
    sweeps_caption: str


def words(guidance: Guidance, experiments: Sequence[Experiment]) -> GuidanceWords:
    """The sentences of the section."""
    return GuidanceWords(
        _lead(guidance.shares),
        _overlap(guidance.shares),
        _raise(guidance.elasticities),
        tuple(_sweep(one) for one in guidance.sweeps),
        _next(guidance.shares, experiments),
        _sweeps_caption(guidance.shares),
    )


def experiment_rows(
    shares: VarianceShares, experiments: Sequence[Experiment]
) -> tuple[tuple[str, str, str], ...]:
    """Further recordings: what, by how much narrower, and what the limit would be known to.

    None where no recording would narrow it: see the sentence.
    """
    if not any(_narrowed(shares, one) <= _HARDLY for one in experiments):
        return ()
    return tuple(
        (
            one.title,
            f"{100 * _narrowed(shares, one):.0f} %",
            f"± {pure(_DB * shares.log_sd * _narrowed(shares, one), 2)} dB",
        )
        for one in experiments
    )


def _narrowed(shares: VarianceShares, one: Experiment) -> float:
    """The width with one more recording over the present one.

    More data narrow the share that is of the parameters; what effects and a misfit add stays.
    """
    return float(np.sqrt(shares.beyond + (1 - shares.beyond) * one.ratio**2))


def _lead(shares: VarianceShares) -> str:
    most = 4
    named = [share for share in shares.shares if share.share >= _NAMED][:most]
    parts = [f"{_name(share)} ({percent(round(share.share, 2))})" for share in named]
    if shares.beyond >= _NAMED:
        parts.append(f"doubt about the model ({percent(round(shares.beyond, 2))})")
    spread = f"± {pure(_DB * shares.log_sd, 2)} dB (one standard deviation)"
    if not parts:
        return f"The critical stiffness is known to {spread}. No parameter stands out in that."
    text = f"The critical stiffness is known to {spread}. That comes from {listed(parts)}."
    return f"{text} {_DOUBT}" if shares.beyond >= _NAMED else text


def _all_of(share: float) -> str:
    """A share of something, in words where it is all of it."""
    return "all of" if round(share, 2) >= 1 else f"{percent(round(share, 2))} of"


def _name(share: Share) -> str:
    names = [short(name) for name in share.names]
    if len(names) == 1:
        return names[0]
    return f"{listed(names)} together"


def _overlap(shares: VarianceShares) -> str:
    text = (
        "A share is the part of the variance that would go if this parameter were known. "
        "Parameters that the data cannot tell apart (rank correlation beyond 0.7) are taken "
        "together."
    )
    together = shares.together
    overlap = 1.1
    if together > overlap:
        return (
            f"{text} The shares add up to {percent(together)}, because parameters that correlate "
            "less than that share some of it, too."
        )
    return text


def _raise(found: Sequence[Elasticities]) -> str:
    sentences = []
    for one in found[:2]:
        if one.crossing.probability < _NAMED:
            continue
        middle = one.median
        order = sorted(middle, key=lambda name: -abs(middle[name]))
        parts = [
            minus(f"{middle[name]:+.2g} % for {short(name)}")
            for name in order[:3]
            if abs(middle[name]) > _FLAT
        ]
        if parts:
            sentences.append(
                f"Where the {_lower(one.crossing.label)} sets the limit (probability "
                f"{percent(one.crossing.probability)}), 1 % more of a parameter changes the limit "
                f"by: {', '.join(parts)}."
            )
    return " ".join(sentences)


def _sweep(one: Sweep) -> str:
    # In relation to now: the sweep's own median is without what widens the limit.
    now = float(np.interp(one.now, one.values, one.middle))
    if one.added:
        end = float(one.middle[-1])
        added = quantity(float(one.values[-1] - one.values[0]), one.unit)
        what = f"{added} more damping at {one.name}"
    else:
        end = float(np.interp(2 * one.now, one.values, one.middle))
        what = f"Twice the stiffness {one.name}" if one.name[0] == "k" else f"Twice {one.name}"
    if abs(end / now - 1) < _FLAT:
        text = f"{what} leaves the limit where it is."
    else:
        step = minus(f"{_DB * np.log(end / now):+.1f} dB")
        text = (
            f"{what} makes the limit {quantity(end / now, '', digits=2)} times what it is ({step})."
        )
    for jump in one.jumps[:2]:
        text += (
            f" Above {one.name} = {quantity(jump.value, one.unit)} the {jump.after} at "
            f"{quantity(jump.after_hz, 'Hz')} binds, below it the {jump.before} at "
            f"{quantity(jump.before_hz, 'Hz')}."
        )
    return text


def _sweeps_caption(shares: VarianceShares) -> str:
    text = (
        "Critical stiffness over one parameter, all others as measured: median, 90 % band, and the "
        "crossing that binds for most draws."
    )
    if shares.beyond >= _NAMED:
        text += " The band is that of the parameters alone, without what widens the limit above."
    return text


def _next(shares: VarianceShares, experiments: Sequence[Experiment]) -> str:
    if not experiments:
        return ""
    best = experiments[0]
    spread = _DB * shares.log_sd
    after = pure(spread * _narrowed(shares, best), 2)
    if _narrowed(shares, best) > _HARDLY:
        return (
            "No further recording of this kind would tell much more of K_CR: "
            f"{_all_of(shares.beyond)} its variance is doubt about the model, and not about its "
            "parameters."
        )
    text = (
        f"Of the further recordings below, each as long as this one, {best.title} would narrow "
        f"K_CR most: from ± {pure(spread, 2)} dB to ± {after} dB."
    )
    known_db = 0.05  # a limit known to this sd needs no further recording
    if spread < known_db:
        text += (
            " But the limit is already known better than a wall needs: look for what the model "
            "lacks rather than for more data."
        )
    return text


def _lower(label: str) -> str:
    return label if label.startswith("Nyquist") else label[:1].lower() + label[1:]
