"""A measurement with what forces took off it put back, or once more without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from bayeshaptic.diagnosis.state import Accepted, Change, State
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares
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
    own, spectra = etfe.recording, etfe.spectra
    assert own is not None and isinstance(spectra, RandomSpectra)
    for change in changes:
        own = replace(
            own,
            force=own.force + sign * change.command,
            position=own.position + sign * change.motion,
        )
        spectra = replace(
            spectra,
            force=spectra.force + sign * change.force,
            position=spectra.position + sign * change.position,
        )
    return replace(etfe, spectra=replace(spectra, louder=louder), recording=own)


def _with_forces_in_parts(etfe: Etfe, changes: Sequence[Change], sign: float) -> Etfe:
    """The same of a recording in several pieces, which nobody holds."""
    whole, spectra = etfe.recording, etfe.spectra
    assert whole is not None and isinstance(spectra, JoinedSpectra)
    for change in changes:
        whole = replace(
            whole,
            force=whole.force + sign * change.command,
            position=whole.position + sign * change.motion,
        )
    parts = tuple(
        with_forces(part, [_of_a_part(change, lines, span) for change in changes], sign)
        for part, lines, span in zip(etfe.parts, spectra.own_lines, etfe.spans, strict=True)
    )
    joined = JoinedSpectra(tuple(part.spectra for part in parts))
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
    bare = left_bare(state, index)
    return replace(bare, fit=least_squares(bare.model, bare.etfe, start=bare.fit.theta))


def left_bare(state: State, index: int) -> State:
    """The state without the accepted effect of an index, and everything else where it is."""
    change = state.accepted[index].change
    assert change is not None
    left = state.accepted[:index] + state.accepted[index + 1 :]
    model, etfe, theta = state.model, state.etfe, state.fit.theta
    if change.effect is not None:
        gone = {parameter.name for parameter in change.effect.parameters}
        theta = theta[[name not in gone for name in model.names]]
        model = model.without_effect(change.effect)
    else:
        etfe = put_back(etfe, change, left)
    return State(etfe, summarise(model, state.fit.windows, theta), left)
