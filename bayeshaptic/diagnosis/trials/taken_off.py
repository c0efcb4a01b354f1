"""A measurement with what forces took off it put back, or once more without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.state import Accepted, Change, State
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimators.joined import JoinedSpectra
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.types import Floats


def with_forces(
    etfe: Etfe, changes: Sequence[Change], sign: float = 1.0, louder: Floats | None = None
) -> Etfe:
    """The measurement with what forces took off put back; with a sign of -1, taken off again.

    `louder`, (W,), is how many times as far a hand moves the device without those forces.
    """
    if etfe.parts:
        return _with_forces_in_parts(etfe, changes, sign)
    spectra = etfe.spectra
    assert isinstance(spectra, RandomSpectra)
    for change in changes:
        spectra = replace(
            spectra,
            force=spectra.force + sign * change.force,
            position=spectra.position + sign * change.position,
        )
    own = _moved(etfe, changes, sign)
    return replace(etfe, spectra=replace(spectra, louder=louder), recording=own)


def _moved(etfe: Etfe, changes: Sequence[Change], sign: float) -> Recording:
    """The recording with what forces add to its samples."""
    own = etfe.recording
    assert own is not None
    force = own.force + sign * sum(change.command for change in changes)
    return replace(own, force=force, position=own.position + sign * sum(c.motion for c in changes))


def _with_forces_in_parts(etfe: Etfe, changes: Sequence[Change], sign: float) -> Etfe:
    """The same of a recording in several pieces, which nobody holds."""
    spectra = etfe.spectra
    assert isinstance(spectra, JoinedSpectra)
    parts = tuple(
        with_forces(part, [_of_a_part(change, lines, span) for change in changes], sign)
        for part, lines, span in zip(etfe.parts, spectra.own_lines, etfe.spans, strict=True)
    )
    joined = JoinedSpectra(tuple(part.spectra for part in parts))
    whole = _moved(etfe, changes, sign)
    return replace(etfe, parts=parts, spectra=joined, recording=whole)


def _of_a_part(change: Change, lines: slice, samples: slice) -> Change:
    """What was taken off one piece of several."""
    return replace(
        change,
        force=_cut(change.force, lines),
        position=_cut(change.position, lines),
        command=_cut(change.command, samples),
        motion=_cut(change.motion, samples),
    )


def _cut(values: Any, own: slice) -> Any:
    return values[own] if np.ndim(values) else values


def put_back(etfe: Etfe, change: Change, rest: Sequence[Accepted]) -> Etfe:
    """The measurement with what one effect took off put back; `rest` is what stays off."""
    spectra = etfe.spectra
    assert isinstance(spectra, RandomSpectra | JoinedSpectra)
    louder = spectra.louder if any(one.acts for one in rest) else None
    return with_forces(etfe, (change,), louder=louder)


def undone(state: State, index: int) -> State:
    """The state without the accepted effect of an index, which has a change to undo."""
    change = state.accepted[index].change
    assert change is not None
    if change.effect is not None:
        bare = left_bare(state, index)
        model, etfe, theta, left = bare.model, bare.etfe, bare.fit.theta, bare.accepted
    else:
        model, theta, left = state.model, state.fit.theta, others(state.accepted, index)
        etfe = put_back(state.etfe, change, left)
    return State(etfe, least_squares(model, etfe, start=theta), left)


def left_bare(state: State, index: int) -> State:
    """The state without the accepted linear effect of an index, and everything else in place."""
    change = state.accepted[index].change
    assert change is not None and change.effect is not None
    model, gone = state.model, {parameter.name for parameter in change.effect.parameters}
    theta = state.fit.theta[[name not in gone for name in model.names]]
    fit = summarise(model.without_effect(change.effect), state.fit.windows, theta)
    return State(state.etfe, fit, others(state.accepted, index))


def others(accepted: tuple[Accepted, ...], index: int) -> tuple[Accepted, ...]:
    """What was accepted besides that of an index."""
    return accepted[:index] + accepted[index + 1 :]
