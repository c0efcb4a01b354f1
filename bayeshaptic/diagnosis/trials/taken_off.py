"""A measurement with what forces took off it put back, or once more without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bayeshaptic.diagnosis.state import Accepted, Change, State
from bayeshaptic.inference.fit import summarise
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.spectra import RandomSpectra
from bayeshaptic.types import Floats


def with_forces(
    etfe: Etfe, changes: Sequence[Change], sign: float = 1.0, louder: Floats | None = None
) -> Etfe:
    """The measurement with what forces took off put back; with a sign of -1, taken off again.

    `louder`, (W,), is how many times as far a hand moves the device without those forces.
    """
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


def put_back(etfe: Etfe, change: Change, rest: Sequence[Accepted]) -> Etfe:
    """The measurement with what one effect took off put back; `rest` is what stays off."""
    spectra = etfe.spectra
    assert isinstance(spectra, RandomSpectra)
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
