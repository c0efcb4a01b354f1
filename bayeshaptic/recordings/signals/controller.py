"""A controller read off a recording: between steps or corners of its reference its law is exact.

There a linear controller obeys

    A(z) u + B(z) y = B(z) r,    and second differences of r are zero,

to the last digit that was written down.  The coefficients that make the second differences of the
left side zero in most samples are its law, and what is left in the others is what it followed.

Of 30 simulated loops each it is read off in 27 that step and 16 that ramp (the others have too few
changes, were cut off or rub), and in none that follow noise, where there is nothing to be read.
That the force is computed shows there, too, where the reference was written down beside it.
"""

from __future__ import annotations

import numpy as np

from bayeshaptic.recordings.recording import Recording
from bayeshaptic.types import Bools, Floats

_LAGS = 3  # an integrator, a filter, and a difference
_ROUNDS = 40  # of weights, the second half of them sharper
_FITTED = 8000  # samples
# Left over, relative to the command's second differences, where nothing changes: rounding.
_EXACT = 1e-5
# A change of the reference stands so far out of what nine samples in ten leave, and is at least
# such a share of the largest: without an exact law nothing does.
_OUT, _SHARE = 30.0, 1e-3
_FEWEST_CHANGES = 8
_MOST_AT_LIMIT = 1e-3  # of the samples: a command that was cut off obeys no law there
# A law of the positions holds in most samples, and leaves half of those at most in which no law of
# the command's own past holds: steps and pauses are laws of that kind.
_MOST, _HALF = 0.5, 0.5


def controller_reference(recording: Recording) -> Floats | None:
    """What the controller followed, through its law, shape (N,); None where no law is exact."""
    if _cut_off(recording.force):
        return None
    parts = []
    for piece in recording.pieces:
        left = _left(piece)
        if left is None:
            return None
        parts.append(left)
    return np.concatenate(parts)


def _cut_off(force: Floats) -> bool:
    at = [np.mean(force == limit) for limit in (force.min(), force.max())]
    return max(at) > max(_MOST_AT_LIMIT, 2 / len(force))


def share_by_a_law(recording: Recording) -> float:
    """In which share of the samples a linear law makes the force of the positions, exactly.

    Where it was written down what the controller followed is in the law, too, so that the law need
    not wait for a reference that rests.  Zero where it is less than half, where the force's own
    past (and the reference) says it as well, or where nothing changes that a controller may follow:
    positions without noise are an exact law of the force.

    Parameters
    ----------
    recording : Recording
    """
    piece = max(recording.pieces, key=lambda one: one.samples)
    found = _left_over(piece)
    if found is None:
        return 0.0
    followed, changes = False, np.count_nonzero(_changes(found))
    if piece.reference is not None and (told := _left_over(piece, followed=True)) is not None:
        explained = np.count_nonzero(np.abs(found) > _EXACT)
        explained -= np.count_nonzero(np.abs(told) > _EXACT)
        if explained >= _FEWEST_CHANGES:
            followed, found, changes = True, told, explained
    left = float(np.mean(np.abs(found) > _EXACT))
    if changes < _FEWEST_CHANGES or left > 1 - _MOST:
        return 0.0
    by_itself = _left_over(piece, own=True, followed=followed)
    if by_itself is None or not left < _HALF * float(np.mean(np.abs(by_itself) > _EXACT)):
        return 0.0
    return 1 - left


def _left(piece: Recording) -> Floats | None:
    left = _left_over(piece)
    if left is None or np.count_nonzero(_changes(left)) < _FEWEST_CHANGES:
        return None
    found = np.zeros(piece.samples)
    found[_LAGS + 2 :] = np.where(_changes(left), left, 0.0)
    return found


def _changes(left: Floats) -> Bools:
    """Where what a controller follows steps or bends."""
    size = np.abs(left)
    most = max(_OUT * float(np.quantile(size, 0.9)), _SHARE * float(size.max()))
    return np.asarray(size > most)


def _left_over(piece: Recording, own: bool = False, followed: bool = False) -> Floats | None:
    """What the sparsest law leaves of second differences of the force, over their size.

    With `own` a law without the positions, with `followed` one with the reference; None where a
    signal of the law does not move.
    """
    force = np.diff(piece.force, 2)
    others = [] if own else [piece.position]
    others += [piece.reference] if followed and piece.reference is not None else []
    signals = [force, *(np.diff(other, 2) for other in others)]
    sizes = [float(np.std(signal)) for signal in signals]
    if min(sizes) == 0:
        return None
    rows = len(force) - _LAGS
    columns = [
        signal[_LAGS - lag : _LAGS - lag + rows] / size
        for signal, size in zip(signals, sizes, strict=True)
        for lag in range(int(signal is force), _LAGS + 1)
    ]
    design, target = np.stack(columns, axis=1), force[_LAGS:] / sizes[0]
    return np.asarray(target - design @ _sparsest(design[:_FITTED], target[:_FITTED]))


def _sparsest(design: Floats, target: Floats) -> Floats:
    """Coefficients that leave nothing in most rows: least absolute errors, reweighted."""
    weight = np.ones(len(target))
    for number in range(_ROUNDS):
        root = np.sqrt(weight)
        law = np.linalg.lstsq(design * root[:, None], target * root, rcond=1e-14)[0]
        left = np.abs(target - design @ law)
        floor = max(float(np.quantile(left, 0.5)), 1e-14) * (1.0 if number < _ROUNDS // 2 else 0.1)
        weight = 1 / np.maximum(left, floor) ** (1.0 if number < _ROUNDS // 2 else 2.0)
        weight /= weight.max()
    kept: Bools = left < max(_EXACT, float(np.quantile(left, 0.5)))
    if np.count_nonzero(kept) > 4 * design.shape[1]:
        law = np.linalg.lstsq(design[kept], target[kept], rcond=1e-14)[0]
    return np.asarray(law)
