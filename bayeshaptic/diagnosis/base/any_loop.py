"""A recording in closed loop of which nothing else is known: any controller is as good."""

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

    It is for recordings with feedback, or where that cannot be decided: not for those in pieces,
    nor for a device that was declared to be one mass, which is followed in time.

    Parameters
    ----------
    found : Opened
    options : Options
    """
    recording = found.etfe.unbroken
    if recording is None or found.one_mass or options.band_hz is not None:
        return None
    if not has_feedback(found.notices) or told_too_little(found.notices):
        return None
    try:
        etfe = estimate_in_any_loop(recording)
    except InputError:
        return None
    how = "was" if is_certain(found.notices) else "may have been"
    text = f"The force {how} computed from the motion, and the device is read from it {_WHATEVER}"
    kept = (n for n in found.notices if n.topic not in ("feedback", "band"))
    notices = (*kept, *etfe.notices, Notice("note", "feedback", text))
    return replace(found, etfe=etfe, notices=notices)


def beyond_reach(fit: Fit) -> Notice | None:
    """That a fit ends where no device is; None where it does not.

    Parameters
    ----------
    fit : Fit
    """
    if not fit.impossible:
        return None
    text = (
        "Of the base models, fitted so that feedback does not bias them, the best ends at a bound "
        f"({', '.join(fit.impossible)}): force and position may not be of the same sample."
    )
    return Notice("warning", "direct", text)


def left_in_any_loop(tests: Iterable[Test]) -> Notice:
    """What no base model explains there.

    Parameters
    ----------
    tests : iterable of Test
        Of which at least one is flagged.
    """
    worst = max((test for test in tests if test.flagged), key=lambda test: test.excess)
    text = (
        f"Of the base models, fitted so that feedback does not bias them, none leaves noise: "
        f"{worst.text}."
    )
    return Notice("warning", "direct", text)
