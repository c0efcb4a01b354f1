"""A recording in closed loop, whatever made it: any controller is as good."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from bayeshaptic.diagnosis.base.opened import Opened
from bayeshaptic.diagnosis.options import Options
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.fit import Fit
from bayeshaptic.recordings.checks.sufficiency import told_too_little
from bayeshaptic.recordings.feedback import has_feedback, is_certain
from bayeshaptic.recordings.response.estimate import estimate_in_any_loop

_WHATEVER = (
    "whatever controller made it: all lines of the spectrum are fitted, up to the Nyquist "
    "frequency, whose sum feedback does not bias. The measured response is biased, and shown for "
    "comparison only."
)


def in_any_loop(found: Opened, options: Options) -> Opened | None:
    """What was opened, with the lines of the direct method; None where it is not for that.

    It is for recordings with feedback, or where that cannot be decided, also where a reference is
    known: not for those in pieces, nor for a device that was declared to be one mass, which is
    followed in time.

    Parameters
    ----------
    found : Opened
    options : Options
    """
    recording = found.etfe.unbroken
    if recording is None or found.one_mass or options.band_hz is not None:
        return None
    through = found.etfe.through_reference
    if not (through or has_feedback(found.notices)) or told_too_little(found.notices):
        return None
    try:
        etfe = estimate_in_any_loop(replace(recording, reference=None))
    except InputError:
        return None
    how = "was" if through or is_certain(found.notices) else "may have been"
    text = f"The force {how} computed from the motion, and the device is read from it {_WHATEVER}"
    kept = (n for n in found.notices if n.topic not in ("feedback", "band"))
    notices = (*kept, *etfe.notices, Notice("note", "feedback", text))
    return replace(found, etfe=etfe, notices=notices)


def against_any_loop(fit: Fit, tests: Iterable[Test], through: bool) -> tuple[Notice, ...]:
    """What stands against the fit there, of which nothing is read then.

    Parameters
    ----------
    fit : Fit
    tests : iterable of Test
    through : bool
        Whether the device is read through a reference instead: of that nothing is asked but that
        no force acts, which all lines show better than those that the reference moves.
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
    return (Notice("warning", "direct", text),)
