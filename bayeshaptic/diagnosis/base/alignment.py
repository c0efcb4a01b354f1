"""Whether force and position in a row of the recording belong to the same instant."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bayeshaptic.diagnosis.base.opened import Opened, opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.criterion import VERY_STRONG, deviance, information_criterion
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.likelihood import Likelihood
from bayeshaptic.models import Model
from bayeshaptic.models.build import with_unknown_delay
from bayeshaptic.models.start import starting_points
from bayeshaptic.quantities import percent, pure, quantity
from bayeshaptic.recordings.feedback import has_feedback
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe, compress
from bayeshaptic.types import Floats

MOVED, LESS_DELAY = "rows moved", "less delay"  # topics of notices
# Where a recording shows less delay than was told by this share of a sampling period, force and
# position of a row are not of one instant: a position that is read between two commands, one that
# was differentiated and integrated again, and the mean of two commands lead by half a period.  The
# mean of three commands filters, too: less delay then leaves no more than the second share of what
# a simpler model misfits by.  How often either is seen, and where it is not there: docs/door.md.
LESS, _REST = 0.25, 0.1
# The reduced chi-square must fall to this share: where a row is of one instant already, it hardly
# falls. How many of those are moved nevertheless: docs/door.md.
_FALLS = 0.9
_WHOLE = 0.05  # of a period: so near to whole ones is one delay in ten
LATER = "extra_delay_s"
# Delays at which a fit to moved rows begins, and starting points of its own beside them. Of 60 fits
# to early positions four stay where they were with one delay and no points, three with four delays
# and no points, and none with four and sixteen: on these the numbers were chosen. How many rows are
# moved that are in time was counted before (docs/door.md).
_WAYS, _OWN = 4, 16


def realigned(
    found: Opened, fit: Fit, model: str | Model, options: Options, simpler: Iterable[Fit] = ()
) -> Opened | None:
    """`found` with its rows put right; None where they are right already, or nothing shows it.

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

    A device cannot answer before it is told to, so that no delay is below zero.  Rows that are
    moved by a sample are fitted as well with one period more of delay, whatever else a model lacks.
    Where positions were written down early, the moved rows are fitted far better, because the rows
    as they are would need a delay below zero.

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
    model, early = _with_any_delay(fit.model), 0
    best = fit if model == fit.model else _from(fit, model, found.etfe)
    # What leaves noise in moved rows alone wants less delay than none in these.
    if to_noise and "delay_s" not in best.impossible:
        return None
    while True:
        moved = _below(best, model, with_rows_moved(recording, early + 1), found)
        if moved is None:
            break
        best, early = moved, early + 1
    if early == 0 or not _delay_s(best) < early * recording.period_s or to_noise and best.misfits:
        return None
    # Of a force that repeats a row less may be a period less, and the fit that was found may lie
    # in a valley of its own: the same rows as recorded.
    etfe = _response(recording.part(early, recording.samples), found)
    if etfe is None:
        return None
    as_recorded = least_squares(model, etfe)
    if not _falls(best, as_recorded):
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
    """A note where the delay beyond the one that was told is a whole number of periods.

    A position that was written down late looks like that.

    Parameters
    ----------
    fit : Fit
        With what was found.
    """
    if LATER not in fit.model.names or fit.model.period_s is None:
        return ()
    place = fit.model.names.index(LATER)
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


def perhaps_early(found: Opened, fit: Fit, simpler: Iterable[Fit]) -> tuple[Notice, ...]:
    """A warning where a model needs nothing but far less delay than was told.

    The chosen one, in which some other parameter may make up for the delay that is missing, and not
    quite; or a simpler one that misfits: a mode too many, damped so much that it only leads, makes
    up for it, as a mass more, or as an effect that was found.

    Parameters
    ----------
    found : Opened
    fit : Fit
        Of the chosen model, with what was found, and with the delay that was told.
    simpler : iterable of Fit
        Of simpler models, with that delay.
    """
    recording, told = found.etfe.recording, fit.model
    told_s = told.fixed.get("delay_s", told.reference.get("delay_s"))
    if recording is None or told_s is None or not _tells(found, recording):
        return ()
    found_too = ", ".join(effect.name.replace("_", " ") for effect in told.effects)
    chosen = f"{told.name} with {found_too}" if found_too else told.name
    for other in (fit, *simpler):
        best = _from(other, _with_any_delay(other.model), found.etfe)
        less_s = told_s - _delay_s(best)
        sd_s = best.sd[best.model.names.index("delay_s")]
        if _needs_less(best, other, fit) and less_s - 2 * sd_s > LESS * recording.period_s:
            text = (
                f"{best.model.name} leaves a reduced chi-square of {pure(best.reduced_chi_square)} "
                f"with {quantity(less_s, 's')} less delay than was told, and {chosen} "
                f"{pure(fit.reduced_chi_square)} with the delay that was told: what it has "
                "besides may only make up for the delay. So it looks where a position is written "
                "down before its command acts, or the command was smoothed in the record alone."
            )
            return (Notice("warning", LESS_DELAY, text),)
    return ()


def _tells(found: Opened, recording: Recording) -> bool:
    """Whether the fitted delay is one of an open loop, from a command to a position."""
    closed = found.etfe.direct or found.etfe.through_reference or has_feedback(found.notices)
    return not closed and recording.sensed is None


def _with_any_delay(model: Model) -> Model:
    """The model with a delay that is inferred, whatever was known of it or added to it."""
    for effect in model.effects:
        if any(parameter.name == LATER for parameter in effect.parameters):
            model = model.without_effect(effect)
    return with_unknown_delay(model)


def _below(known: Fit, model: Model, recording: Recording, found: Opened) -> Fit | None:
    """The fit to rows moved by one sample, where it is better than that to the rows as they are.

    The search begins at the known fit with one period more of delay, which fits as well; only rows
    that would need a delay below zero gain from there.  A full search costs ten times as much, and
    follows only where this one gains.
    """
    etfe = _response(recording, found)
    if etfe is None or not _falls(_from(known, model, etfe, later_s=etfe.period_s), known):
        return None
    moved = least_squares(model, etfe)
    return moved if _falls(moved, known) else None


def _response(recording: Recording, found: Opened) -> Etfe | None:
    try:
        return estimate_etfe(recording, found.etfe.band_hz)
    except InputError:  # of a force that repeats too few periods are left
        return None


def _from(known: Fit, model: Model, etfe: Etfe, later_s: float = 0.0) -> Fit:
    """The fit of a model with any delay that begins at a known one.

    Up to `later_s` later, and then at a few starting points of its own as well.
    """
    values = {**known.model.fixed, **dict(zip(known.model.names, known.theta, strict=True))}
    delay_s = values.get("delay_s", 0.0) + values.get(LATER, 0.0)
    delays_s = delay_s + later_s * np.linspace(0.0, 1.0, _WAYS if later_s else 1)
    start = np.array([[{**values, "delay_s": at}[name] for name in model.names] for at in delays_s])
    if later_s:
        start = np.concatenate([start, _promising(model, etfe)])
    return least_squares(model, etfe, start=start)


def _promising(model: Model, etfe: Etfe) -> Floats:
    points = starting_points(model, etfe, np.random.default_rng(0))
    with np.errstate(all="ignore"):
        left = Likelihood(model, compress(etfe)).reduced_chi_square(points)
    return points[np.argsort(left)[:_OWN]]


def _needs_less(best: Fit, other: Fit, fit: Fit) -> bool:
    """Whether a model with any delay explains far more than with the one that was told.

    Where that left nothing but noise: surely more, and no less than the chosen fit.
    """
    if other.misfits:
        rest = (best.reduced_chi_square - 1) / (other.reduced_chi_square - 1)
        return rest < _REST or not best.misfits
    gain = deviance(other, noise=1.0)[0] - deviance(best, noise=1.0)[0]
    better = information_criterion(best, noise=1.0) < information_criterion(fit, noise=1.0)
    return gain > VERY_STRONG and better


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
