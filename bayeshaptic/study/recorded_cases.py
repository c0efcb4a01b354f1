"""Cases of single recordings, and how much wider their limits are than their draws say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.effects.library import registered
from bayeshaptic.errors import Notice
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.quantities import interval
from bayeshaptic.recordings.join import name_of_several
from bayeshaptic.stability.cases import FREE, Case
from bayeshaptic.stability.critical import CriticalStiffness, critical_stiffness
from bayeshaptic.stability.draws import draws_of
from bayeshaptic.study.analysed import Analysed
from bayeshaptic.types import Floats

_CONTRADICT = 1.5  # times between the intervals of two limits of one device


@dataclass(frozen=True)
class Widening:
    """What closing the loop adds to limits: effects, what is unexplained, what could hide.

    Attributes
    ----------
    shift, log_sd : ndarray, shape (R,)
        Of log K_CR, in each recording: of effects, and of what is unexplained.
    hidden : tuple of ndarray
        Draws of what could hide does to log K_CR, in each recording.  They are no normal variable:
        mostly nothing, and now and then far down.
    """

    shift: Floats
    log_sd: Floats
    hidden: tuple[Floats, ...]

    def apply(self, limit: CriticalStiffness, rng: np.random.Generator) -> CriticalStiffness:
        """The limit with each draw widened as one of the recordings, at random."""
        if not (self.shift.any() or self.log_sd.any() or any(one.any() for one in self.hidden)):
            return limit
        which = rng.integers(len(self.shift), size=len(limit.samples))
        log_factor = self.shift[which] + self.log_sd[which] * rng.standard_normal(len(which))
        for number, draws in enumerate(self.hidden):
            rows = which == number
            log_factor[rows] += rng.choice(draws, size=int(rows.sum()))
        return replace(limit, samples=limit.samples * np.exp(log_factor))


def widening(some: Sequence[Analysed]) -> Widening:
    """How the limits of closed loops differ from those of their posteriors; nothing elsewhere."""
    table = [_widening(one) for one in some]
    shift, log_sd = np.array([own[:2] for own in table], float).reshape(-1, 2).T
    return Widening(shift, log_sd, tuple(own[2] for own in table))


def _widening(one: Analysed) -> tuple[float, float, Floats]:
    """Shift, standard deviation and draws of what could hide, of one recording."""
    analysis = one.analysis
    if analysis is None or analysis is one.result:
        return 0.0, 0.0, np.zeros(1)
    # All draws, since those of the limit are all: equal limits then differ by nothing at all, and
    # no threshold has to tell a small difference from that of other draws.
    plain = critical_stiffness(analysis.posterior).samples
    exact = (analysis.limit if analysis.hidden is None else analysis.hidden.declared).samples
    before, after = _logs(plain), _logs(exact)
    shift = float(after.mean() - before.mean())
    log_sd = float(np.sqrt(max(after.var() - before.var(), 0.0)))
    if analysis.hidden is None:
        return shift, log_sd, np.zeros(1)
    good = np.isfinite(exact) & (exact > 0)  # what could hide is one factor a draw
    hidden = np.log(analysis.limit.samples[good] / exact[good])
    return shift, log_sd, hidden if len(hidden) else np.zeros(1)


def _logs(samples: Floats) -> Floats:
    """Logs of what is neither zero nor infinite."""
    good = samples[np.isfinite(samples) & (samples > 0)]
    return np.log(good) if len(good) > 1 else np.zeros(2)


def posterior(one: Analysed) -> Posterior:
    """The posterior of a recording that did not fail."""
    assert one.analysis is not None
    return one.analysis.posterior


def signature(one: Analysed) -> tuple[str, ...]:
    """What recordings must have in common to be pooled: parameters, accepted effects, the period.

    A limit is that of a loop of one period, which time stamps give to some digits.
    """
    return (*posterior(one).names, *sorted(one.effects), f"{period_s(one):.3e}")


def period_s(one: Analysed) -> float:
    """Of the loop that the limit of a recording is for."""
    found = posterior(one).model.period_s
    assert found is not None  # without one there is no limit
    return found


def place_of(configuration: float | str | None) -> str:
    """How a label goes on with a configuration; nothing without one."""
    if configuration is None:
        return ""
    name = configuration if isinstance(configuration, str) else f"{configuration:g}"
    return f", configuration {name}"


def contradictions(free: Sequence[Analysed]) -> tuple[Notice, ...]:
    """Recordings that nobody holds, in one configuration, whose limits or effects differ.

    No hand differs between them, so that of one device they would agree.

    Parameters
    ----------
    free : sequence of Analysed
        Those that did not fail.
    """
    found: dict[str, list[Analysed]] = {}
    for one in free:
        found.setdefault("nobody holds it" + place_of(one.entry.configuration), []).append(one)
    texts = [
        _contradict(label, low, high)
        for label, some in found.items()
        for low, high in ((min(some, key=_upper), max(some, key=_lower)),)
        if _lower(high) > _CONTRADICT * _upper(low)
    ]
    for label, some in found.items():
        kinds = {one.effects: [o.name for o in some if o.effects == one.effects] for one in some}
        if len({_told_apart(effects) for effects in kinds}) > 1:
            texts.append(_other_effects(label, kinds))
    return tuple(Notice("warning", "contradiction", text) for text in texts)


def _told_apart(effects: Sequence[str]) -> tuple[str, ...]:
    """Effects as far as a recording tells them apart, one name for all that are tied.

    Whether the force follows late or the position is read late, say, is chance: two recordings of
    one device may have either.
    """
    known = registered()
    return tuple(sorted(min((name, *getattr(known.get(name), "ties", ()))) for name in effects))


def _other_effects(label: str, kinds: Mapping[tuple[str, ...], Sequence[str]]) -> str:
    told = "; ".join(
        f"{', '.join(effects) or 'no effect'} in {' and '.join(names)}"
        for effects, names in kinds.items()
    )
    return (
        f"Recordings of one case ({label}) do not agree about what the device has: {told}. Did it "
        "change between them? Each kind is a case of its own, and the limit of the device allows "
        "for all of them."
    )


def _contradict(label: str, low: Analysed, high: Analysed) -> str:
    ends = " and ".join(
        f"{one.name} {interval(_lower(one), _upper(one), _limit(one).unit)}" for one in (low, high)
    )
    return (
        f"Recordings of one case ({label}) contradict each other: the limit by {ends}. Are both of "
        "one device, in one configuration and in the same units? The case has the draws of both."
    )


def _limit(one: Analysed) -> CriticalStiffness:
    assert one.analysis is not None
    return one.analysis.limit


def _lower(one: Analysed) -> float:
    return float(_limit(one).quantile(0.05))


def _upper(one: Analysed) -> float:
    return float(_limit(one).quantile(0.95))


def recorded(some: Sequence[Analysed], group: str, beside: Sequence[Case] = ()) -> tuple[Case, ...]:
    """One case for each user (or nobody), configuration and model; its trials in equal shares.

    No two have one label, nor one of those `beside` them: a user's recordings may be in the
    population but for one.
    """
    found: dict[tuple[object, ...], list[Analysed]] = {}
    for one in some:
        entry = one.entry
        found.setdefault((entry.user, entry.configuration, *signature(one)), []).append(one)
    own = [_label(trials[0], group) for trials in found.values()]
    labels = [*own, *(case.label for case in beside)]
    return tuple(
        _pooled(
            label
            if labels.count(label) == 1
            else f"{label} ({name_of_several(trials[0].name, len(trials) - 1)})",
            group,
            trials,
        )
        for label, trials in zip(own, found.values(), strict=True)
    )


def _label(one: Analysed, group: str) -> str:
    who = "nobody holds it" if group == FREE else f"user {one.entry.user}"
    return who + place_of(one.entry.configuration)


def _pooled(label: str, group: str, trials: Sequence[Analysed]) -> Case:
    """All trials of one case, as many draws of each."""
    analyses = [one.analysis for one in trials if one.analysis is not None]
    user, configuration = trials[0].entry.user, trials[0].entry.configuration
    model = analyses[0].model
    draws = [_in_order(one) for one in analyses]
    if len(analyses) == 1:
        joined, limit = draws[0], analyses[0].limit
        return Case(label, group, model, joined, limit, user=user, configuration=configuration)
    count = min(len(one) for one in draws)
    picks = [np.linspace(0, len(one) - 1, count).astype(int) for one in draws]
    joined = np.concatenate([one[pick] for one, pick in zip(draws, picks, strict=True)])
    samples = [a.limit.samples[pick] for a, pick in zip(analyses, picks, strict=True)]
    # Samples are kept as they are: a closed loop may have widened them.
    limit = replace(critical_stiffness(model, joined), samples=np.concatenate(samples))
    return Case(label, group, model, joined, limit, user=user, configuration=configuration)


def _in_order(analysis: Analysis) -> Floats:
    """Draws of a posterior in the order of its limit's samples."""
    draws = draws_of(analysis.posterior)
    count = len(analysis.limit.samples)
    if len(draws) == count:
        return draws
    return draws[np.linspace(0, len(draws) - 1, count).astype(int)]
