"""Rare faults of a logger: rows that are missing, and single samples that are wild."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.samples.prediction import Bools, Floats, Predictor, Samples
from bayeshaptic.recordings.signals.lone import lone

_ERRORS = 5.0  # how badly a sample must be predicted to be looked at
_WILD = 8.0  # how far off a wild one must be, in the same measure
_FAR = 5.0  # of that measure again, as many as one wild sample counts for at most
_EQUATIONS = (24, 10, 6)  # predictions that a fault must explain; fewer where faults lie close
_A_ROW = 4.0  # squared errors that a further missing row must explain
_SIMPLER = 8.0  # and that a gap must explain more than a wild sample


@dataclass(frozen=True)
class Faults:
    """What was found.

    Attributes
    ----------
    lost : int
        Rows that were missing.
    samples : Samples
        With the missing rows put back, their positions known to be missing.
    wild : ndarray of bool, shape (N,)
        Wild samples, in the rows of `samples`.
    wild_score : float
        How far off they are, in eight errors of the prediction and five at most each, less the
        number of samples that are badly predicted for no reason found.
    """

    lost: int
    samples: Samples
    wild: Bools
    wild_score: float


@dataclass(frozen=True)
class _Gap:
    """Rows missing before a sample, with their force as far as the motion shows it."""

    before: int
    force: Floats


@dataclass(frozen=True)
class _Look:
    """Gaps, wild samples, how many badly predicted samples are neither; and by which predictor."""

    gaps: list[_Gap]
    wild: Bools
    unexplained: int
    predictor: Predictor


@dataclass(frozen=True)
class _Trial:
    """An explanation: what it leaves of the squared errors, over their variance, and its values."""

    left: float
    at: int
    position: Floats
    force: Floats


def faults(samples: Samples) -> Faults:
    """Rows that are missing, and wild samples.

    Where a sample is badly predicted several explanations compete: it alone is wrong; rows are
    missing before it; or a force struck the device, which is no fault.
    """
    lost, mended, predictor = 0, samples, samples.predictor
    if predictor is None:
        return Faults(0, samples, np.zeros(samples.recording.samples, dtype=bool), 0.0)
    look = _look(samples, predictor)
    passes = 3  # what lies close behind a gap is seen when the gap is mended
    sensed = samples.recording.sensed
    if sensed is not None and sensed.derivatives:
        passes = 0  # an integral lacks the motion in rows that were lost, and does not jump there
    for _ in range(passes):
        if len(look.gaps) <= look.unexplained:
            break
        lost += sum(len(gap.force) for gap in look.gaps)
        if lost <= thresholds.LOST:
            break
        mended = _restored(mended, look.gaps)
        look = _look(mended, look.predictor)
    wild = look.wild | lone(mended.recording.position)
    off = np.abs(mended.recording.position - mended.without(wild).position)[wild]
    # Four that just are wild are none; one that is far beyond is one.
    far = np.minimum(off / (_WILD * look.predictor.spread), _FAR)
    return Faults(lost, mended, wild, float(far.sum()) - look.unexplained)


def _look(samples: Samples, predictor: Predictor) -> _Look:
    """Explain every badly predicted sample, with a predictor that has not seen it."""
    wild = np.zeros(samples.recording.samples, dtype=bool)
    suspects = _suspects(samples, predictor)
    most = 300  # more are no faults but noise
    if 0 < len(suspects) <= most:
        predictor = samples.without(_marked(suspects, wild)).predictor or predictor
        suspects = _suspects(samples, predictor)
    if len(suspects) > most:
        return _Look([], wild, len(suspects), predictor)
    gaps: list[_Gap] = []
    unexplained = 0
    for suspect in suspects:
        tried = (_explanation(predictor, samples, int(suspect), n) for n in _EQUATIONS)
        found = next((each for each in tried if each is not None), None)
        if found is None:
            unexplained += 1
        elif isinstance(found, int):
            wild[found] = True
        elif not gaps or found.before - gaps[-1].before > 2:
            gaps.append(found)
    return _Look(gaps, wild, unexplained, predictor)


def _suspects(samples: Samples, predictor: Predictor) -> NDArray[np.intp]:
    """Samples predicted worse than rounding explains, that follow no other one closely.

    A motion of less than a count a sample jumps by one now and then: as many spreads as a fault.
    """
    errors = predictor.errors(samples.position, samples.recording.force)
    rounding = 0.5 * samples.unit * np.sum(np.abs(predictor.past))
    bad = np.flatnonzero(np.abs(errors) > max(_ERRORS * predictor.spread, rounding))
    bad = bad[(bad > predictor.order + 2) & (bad < len(errors) - max(_EQUATIONS) - 2)]
    apart = 12  # samples badly predicted closer to each other have one cause
    return bad[np.diff(bad, prepend=-apart) >= apart]


def _marked(index: NDArray[np.intp], like: Bools) -> Bools:
    marked = np.zeros_like(like)
    marked[index] = True
    return marked


def _explanation(
    predictor: Predictor, samples: Samples, suspect: int, equations: int
) -> _Gap | int | None:
    """Rows missing, a wild sample (its index), or neither."""

    def trial(at: int, **unknown: int) -> _Trial:
        return _trial(predictor, samples, at, equations, **unknown)

    here = (suspect, suspect - 1)
    wild = _best(trial(at, position=1) for at in here)
    longest = 3  # rows missing in one place
    gap = _best(
        trial(at, missing=length, position=length, force=length)
        for length in range(1, min(longest, equations // 4) + 1)
        for at in (*here, suspect + 1)
    )
    best = min(wild.left, gap.left)
    rival = _best([trial(suspect), *(trial(at, force=1) for at in here)])
    convincing = 30.0  # gain in squared errors over their variance
    left = 2.5  # squared error a prediction over its variance that may remain
    if rival.left - best < convincing or best > left * equations:
        return None
    if wild.left > gap.left + _SIMPLER:
        return _Gap(gap.at, gap.force)
    return wild.at if abs(wild.position[0]) > _WILD * predictor.spread else None


def _best(trials: Iterable[_Trial]) -> _Trial:
    return min(trials, key=lambda trial: trial.left + _A_ROW * len(trial.force))


def _trial(
    predictor: Predictor,
    samples: Samples,
    at: int,
    equations: int,
    missing: int = 0,
    position: int = 0,
    force: int = 0,
) -> _Trial:
    """Solve for unknown positions and forces from a sample on.

    Parameters
    ----------
    predictor : Predictor
    samples : Samples
    at, equations : int
    missing : int
        Rows to insert before that sample; the unknowns are then theirs.
    position, force : int
        How many positions and forces are unknown.
    """
    order = predictor.order
    here, blank = slice(at - order, at + equations), np.zeros(missing)
    y, u = samples.position[here], samples.recording.force[here]
    centre = y[order - 1]  # small numbers keep their digits
    y = np.concatenate([y[:order] - centre, blank, y[order:] - centre])
    u = np.concatenate([u[:order], blank, u[order:]])
    rows = slice(order, order + equations)
    errors = np.convolve(y, predictor.past)[rows] - np.convolve(u, predictor.force)[rows]
    errors += centre * predictor.past.sum() - predictor.constant
    design = np.zeros((equations, position + force))
    for j in range(position):
        design[j:, j] = predictor.past[: equations - j]
    for j in range(force):
        design[j:, position + j] = -predictor.force[: equations - j]
    # Between pulses nothing tells of the force, and the predictor gives it no effect.
    scale = np.maximum(np.abs(design).max(axis=0), np.finfo(float).tiny)
    values = np.linalg.lstsq(design / scale, -errors, rcond=1e-10)[0] / scale
    if missing:  # their forces were commanded as those of the other rows
        values[position:] = np.clip(values[position:], *samples.range_of_force)
        free, rest = slice(0, position), errors + design[:, position:] @ values[position:]
        places = design[:, free] / scale[free]
        values[free] = np.linalg.lstsq(places, -rest, rcond=1e-10)[0] / scale[free]
    errors = errors + design @ values
    left = float(errors @ errors) / predictor.spread**2
    return _Trial(left, at, values[:position], values[position:])


def _restored(samples: Samples, gaps: list[_Gap]) -> Samples:
    """With the missing rows put back, their positions known to be missing."""
    recording = samples.recording
    at = np.concatenate([[gap.before] * len(gap.force) for gap in gaps]).astype(int)
    force = np.insert(recording.force, at, np.concatenate([gap.force for gap in gaps]))
    position = np.insert(recording.position, at, recording.position[at - 1])
    lost = np.insert(np.zeros(recording.samples, dtype=bool), at, True)
    missing = np.insert(samples.missing, at, True)
    position[lost] = np.interp(np.flatnonzero(lost), np.flatnonzero(~lost), position[~lost])
    return Samples(replace(recording, force=force, position=position), missing)
