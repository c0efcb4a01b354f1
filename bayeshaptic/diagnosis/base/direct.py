"""Whether the direct method may read a recording made in closed loop, and what speaks against."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from bayeshaptic.diagnosis.base.opened import Opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.feedback import doubts, has_feedback, how_computed
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_by_direct_method
from bayeshaptic.recordings.signals.turns import hung

AGAINST = "closed-loop fit"  # the topic of what speaks against such a fit
_WHATEVER = (
    "whatever controller made it: all lines of the spectrum are fitted, up to the Nyquist "
    "frequency, whose sum feedback does not bias. The measured response is biased then, and shown "
    "for comparison only. A force that a sensor measured at the hand must not be in the command "
    "(power assist, admittance control): the limit would be another, and nothing here shows it."
)


def opened_directly(found: Opened, options: Options, longest: bool = False) -> Opened | None:
    """`found` with the spectra of the direct method; None where the method is not meant for it.

    It is meant for recordings with feedback, and for those where feedback cannot be ruled out, also
    where a reference is known.  It is not meant for a band that was asked for (it needs all lines),
    or for a device declared to be one mass, which is followed in time.  Where the reading hung, the
    longest part without is fitted, and of several pieces the longest.

    Parameters
    ----------
    found : Opened
    options : Options
    longest : bool
        Of several pieces also where a reference is known, through which all of them can be read.
    """
    through = found.etfe.through_reference
    recording, alone = _longest(found.etfe.recording)
    if recording is None or (alone and through and not longest):
        return None
    if found.one_mass or options.band_hz is not None:
        return None
    if not (through or has_feedback(found.notices)) or told_too_little(found.notices):
        return None
    try:
        read, hangs = _while_it_was_read(recording)
        etfe = estimate_by_direct_method(replace(read, reference=None))
    except InputError:
        return None
    how = how_computed(found.notices)
    text = f"The force {how}; the device is read from it {_WHATEVER}"
    kept = (n for n in found.notices if n.topic not in ("feedback", "band"))
    note = Notice("note", "feedback", text, doubts(found.notices))
    notices = (*kept, *etfe.notices, note, *alone, *hangs)
    return replace(found, etfe=etfe, notices=notices)


def _longest(recording: Recording | None) -> tuple[Recording | None, tuple[Notice, ...]]:
    """The longest piece of a recording, and a warning that the others take no part."""
    if recording is None or not recording.joints:
        return recording, ()
    longest = max(recording.pieces, key=lambda piece: piece.samples)
    others = len(recording.pieces) - 1
    text = (
        f"In closed loop one piece is fitted: {longest.name}, the longest of {others + 1} "
        f"({quantity(longest.duration_s, 's')}). The other{'s take' if others > 1 else ' takes'} "
        "no part; report on each by itself, too."
    )
    return longest, (Notice("warning", "pieces", text),)


def _while_it_was_read(recording: Recording) -> tuple[Recording, tuple[Notice, ...]]:
    """The longest part in which the reading did not hang, and a warning where it did.

    What a controller answered to was what it read: nothing can be filled in there.
    """
    hangs = hung(recording.position, recording.period_s)
    if not hangs:
        return recording, ()
    starts = [0, *(rows.stop for rows in hangs)]
    stops = [*(rows.start for rows in hangs), recording.samples]
    start, stop = max(zip(starts, stops, strict=True), key=lambda part: part[1] - part[0])
    first, *others = hangs
    times = f"{len(hangs)} times, the first time " if others else ""
    text = (
        f"The position hangs {times}in rows {first.start + 1} to {first.stop}, and jumps to where "
        f"the device has gone since. Rows {start + 1} to {stop} alone were fitted."
    )
    return recording.part(start, stop), (Notice("warning", "jumps", text),)


def against_direct(fit: Fit, tests: Iterable[Test], through: bool) -> tuple[Notice, ...]:
    """What speaks against a fit by the direct method; nothing is read from that fit then.

    Parameters
    ----------
    fit : Fit
    tests : iterable of Test
    through : bool
        Whether the device is read through a reference instead.  Then it matters only whether a
        nonlinear force acts, which all lines show better than those that the reference moves.
    """
    flagged = [test for test in tests if test.flagged]
    if through:
        flagged = [test for test in flagged if test.family == "nonlinear"]
    if flagged:
        why = f"none leaves noise: {max(flagged, key=lambda test: test.excess).text}"
    elif fit.impossible and not through:
        why = (
            f"the best ends at a bound ({', '.join(fit.impossible)}): force and position may not "
            "be of the same sample"
        )
    else:
        return ()
    text = f"Of the base models, fitted so that feedback does not bias them, {why}."
    return (Notice("warning", AGAINST, text),)
