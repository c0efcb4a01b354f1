"""Whether force and position of a row are of one sample, as far as the best fit tells."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.base.opened import Opened, opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.models import Model
from bayeshaptic.models.build import with_unknown_delay
from bayeshaptic.quantities import percent, pure
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe

MOVED = "rows moved"  # topic of the notice
# The reduced chi-square must fall to this share; rows of one sample hardly change it. How many of
# those are moved nevertheless: docs/door.md.
_FALLS = 0.9
_WHOLE = 0.05  # of a period: so near to whole ones is one delay in ten
_LATER = "extra_delay_s"
_SAME = 0.02  # relative difference of reduced chi-squares in one valley


def realigned(
    found: Opened, fit: Fit, model: str | Model, options: Options, simpler: Iterable[Fit] = ()
) -> Opened | None:
    """What was opened, with rows of one sample; None where they are, or nothing tells.

    Parameters
    ----------
    found : Opened
    fit : Fit
        Of a model to what was opened, with linear effects or without.
    model : str or Model
        As asked for.
    options : Options
    simpler : iterable of Fit
        Of simpler models. A mode too many takes up the lead of a position that is early, so that
        nothing is left: then a model without it must leave nothing in moved rows.
    """
    moved = rows_of_one_sample(found, fit)
    for other in simpler:
        moved = moved or rows_of_one_sample(found, other, to_noise=True)
    if moved is None:
        return None
    recording, notice = moved
    again = opened(recording, model, options)
    return replace(again, notices=(*again.notices, notice))


def rows_of_one_sample(
    found: Opened, fit: Fit, to_noise: bool = False
) -> tuple[Recording, Notice] | None:
    """The recording with every force beside the position that was read when it was commanded.

    No device answers before it is told to.  Whatever a model lacks, it fits rows that are moved
    by a sample as well, with a period more of delay.  Rows whose position was written down early
    it fits far better so, since no delay is less than none.

    Parameters
    ----------
    found : Opened
    fit : Fit
        Of a model to what was opened.
    to_noise : bool
        Only where nothing but noise is left in them.

    Returns
    -------
    recording : Recording
        Shorter by the samples that it was moved.
    notice : Notice
        That it was.

    None where the rows are as they should be, or nothing tells.
    """
    recording = found.etfe.recording
    if recording is None or not (fit.misfits or fit.impossible) or not _tells(found, recording):
        return None
    model, best, early = _with_any_delay(fit.model), fit, 0
    while True:
        there = with_rows_moved(recording, early + 1)
        moved = _best(model, there, found, best, only_down=to_noise)
        if moved is None or not _falls(moved, best):
            break
        best, early = moved, early + 1
    if early == 0 or not _delay_s(best) < early * recording.period_s or to_noise and best.misfits:
        return None
    # A delay that was told may be wrong, and of a force that repeats a row less may be a period
    # less: the same rows as recorded, with whatever delay.
    as_recorded = _best(model, recording.part(early, recording.samples), found)
    if as_recorded is None or not _falls(best, as_recorded):
        return None
    notice = _notice(early, as_recorded.reduced_chi_square, best.reduced_chi_square)
    return with_rows_moved(recording, early), notice


def with_rows_moved(recording: Recording, early: int) -> Recording:
    """With the position of each row beside the force of the row `early` samples later."""
    pieces = recording.pieces
    ends = np.cumsum([piece.samples - early for piece in pieces])
    return replace(
        recording,
        force=np.concatenate([piece.force[early:] for piece in pieces]),
        position=np.concatenate([piece.position[:-early] for piece in pieces]),
        joints=tuple(int(end) for end in ends[:-1]),
    )


def perhaps_late(fit: Fit) -> tuple[Notice, ...]:
    """That a delay beyond the told one is whole periods, as of a position written down late.

    Parameters
    ----------
    fit : Fit
        With what was found.
    """
    if _LATER not in fit.model.names or fit.model.period_s is None:
        return ()
    place = fit.model.names.index(_LATER)
    periods, sd = fit.theta[place] / fit.model.period_s, fit.sd[place] / fit.model.period_s
    late = round(periods)
    if late < 1 or not abs(periods - late) + sd < _WHOLE:
        return ()
    what = "one sampling period" if late == 1 else f"{late} sampling periods"
    samples = "one sample" if late == 1 else f"{late} samples"
    text = (
        f"The delay beyond the one that was told is {what}, to {percent(_WHOLE)}: a position that "
        f"was written down {samples} late looks just like that. If it was, the loop itself has no "
        "such delay and a higher limit: write force and position down at the same moment."
    )
    return (Notice("note", "alignment", text),)


def _tells(found: Opened, recording: Recording) -> bool:
    """Whether the delay of the fit is that of an open loop, from a command to a position."""
    closed = found.etfe.direct or found.etfe.through_reference or has_feedback(found.notices)
    return not closed and recording.sensed is None


def _with_any_delay(model: Model) -> Model:
    """The model with a delay that is inferred, whatever was known of it or added to it."""
    for effect in model.effects:
        if any(parameter.name == _LATER for parameter in effect.parameters):
            model = model.without_effect(effect)
    return with_unknown_delay(model)


def _best(
    model: Model,
    recording: Recording,
    found: Opened,
    known: Fit | None = None,
    only_down: bool = False,
) -> Fit | None:
    """The best fit, None where there is no response; `known` is that of rows a sample apart.

    What ends there at once is the same fit with another delay, and not looked for again.  With
    `only_down` nothing is where the way from the known one does not lead down: with a period more
    of delay it leaves the same, and only what wants less delay than none has anything to gain.
    """
    try:
        etfe = estimate_etfe(recording, found.etfe.band_hz)
    except InputError:  # of a force that repeats too few periods are left
        return None
    if only_down and known is not None and not _falls(_from(known, model, etfe), known):
        return None
    fit = least_squares(model, etfe, most_sets=1)
    there = np.nan if known is None else known.reduced_chi_square
    if fit.misfits and not abs(fit.reduced_chi_square / there - 1) < _SAME:
        fit = least_squares(model, etfe)
    return fit


def _from(known: Fit, model: Model, etfe: Etfe) -> Fit:
    """The fit of a model with any delay that begins at one to rows a sample less apart."""
    values = {**known.model.fixed, **dict(zip(known.model.names, known.theta, strict=True))}
    values["delay_s"] = values.get("delay_s", 0.0) + values.get(_LATER, 0.0) + etfe.period_s
    return least_squares(model, etfe, start=np.array([values[name] for name in model.names]))


def _falls(after: Fit, before: Fit) -> bool:
    return after.reduced_chi_square < _FALLS * before.reduced_chi_square


def _delay_s(fit: Fit) -> float:
    return float(fit.theta[fit.model.names.index("delay_s")])


def _notice(early: int, as_recorded: float, left: float) -> Notice:
    samples = "one sample" if early == 1 else f"{early} samples"
    text = (
        f"The position answers {samples} before its command acts: with whatever delay, the best "
        f"fit leaves a reduced chi-square of {pure(as_recorded)} as recorded, and {pure(left)} "
        f"with each force beside the position {samples} before it. Everything here is read from "
        "the rows moved so. Write force and position down at the same moment: the position that "
        "was read, beside the force that was commanded then."
    )
    return Notice("warning", MOVED, text)
