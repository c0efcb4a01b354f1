"""Does an actuator give less the faster it moves?  A supply that is used up does.

Its voltage drives the current and stands against what the motor induces as it turns.  So it gives
less of a force along the motion, and more of one against it, which a linear model takes for
damping; in small motions that damping is not there.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.columns import (
    as_normal,
    common_coefficient,
    driven_velocity,
    response_to,
)
from bayeshaptic.diagnosis.residuals.lines import Lines
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.state import Accepted
from bayeshaptic.effects.nonlinear.protocol import Acting, CommandEffect
from bayeshaptic.effects.nonlinear.shapes import COMMAND
from bayeshaptic.inference.fit import Fit
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import remembered
from bayeshaptic.types import Floats

SPEED = "u |v|"  # the test for a gain that goes with the speed
LIMIT = "limit over speed"  # that for a limit that does
SPENT = (
    "the actuator gives another share of the command the faster it moves, and what the model takes "
    "for damping may be that"
)
"""What is said where one of them is flagged."""


def speed_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """Does the actuator give less of the command, or more, the faster it moves?

    That is no function of the command alone, nor of the motion alone.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
        Of a recording in open loop; of one in pieces, or that repeats, nothing is asked.
    """
    recording = _asked(etfe)
    if recording is None:
        return ()
    speed = np.abs(driven_velocity(fit, recording))
    force = recording.force - recording.force.mean()
    share, score = _found(fit, etfe, recording, force * speed / np.sqrt(np.mean(speed**2)))
    text = (
        f"a gain that is {percent(abs(share))} {'less' if share < 0 else 'more'} at the usual "
        f"speed than at rest stands {score:.1f} standard deviations out of the noise"
    )
    return (Test(SPEED, "nonlinear", score, thresholds.two_sided(), None, text),)


def limit_tests(fit: Fit, etfe: Etfe, accepted: Iterable[Accepted]) -> tuple[Test, ...]:
    """Does the limit of an actuator that saturates go with its speed?

    It then gives less of the commands beyond the limit along the motion alone.  That is a damper
    which is there while the limit is reached, and in a gain that goes with the speed hardly seen.

    Parameters
    ----------
    fit, etfe : Fit, Etfe
        As for `speed_tests`, with what the limit keeps back taken off.
    accepted : iterable of Accepted
        Asked of a saturation among them.
    """
    recording = _asked(etfe)
    acting = next((found for effect in accepted if (found := _limited(effect))), None)
    if recording is None or acting is None:
        return ()
    velocity = driven_velocity(fit, recording)
    usual = float(np.sqrt(np.mean(velocity**2)))
    less = -_beyond(acting, recording.force) * velocity / usual
    fall, score = _found(fit, etfe, recording, less)
    text = (
        f"a limit that is {percent(abs(fall) / acting.strength)} {'less' if fall > 0 else 'more'} "
        f"at the usual speed than at rest stands {score:.1f} standard deviations out of the noise"
    )
    # It is asked of recordings that something was taken off alone, where thresholds are higher.
    threshold = thresholds.two_sided() / thresholds.MENDED
    return (Test(LIMIT, "nonlinear", score, threshold, None, text),)


def _asked(etfe: Etfe) -> Recording | None:
    return None if etfe.period_lines is not None else etfe.unbroken


def _limited(effect: Accepted) -> Acting | None:
    """The saturation that an accepted effect is; None where it is none that can be taken out."""
    acting = effect.change.acting if effect.change else None
    return acting if acting and acting.effect.strength[0] == "force_limit" else None


def _beyond(acting: Acting, command: Floats) -> Floats:
    """How far each command is given by the limit alone: 1 where it is far beyond, 0 within."""
    assert isinstance(acting.effect, CommandEffect)
    low, high = (1 + side * 1e-4 for side in (-1, 1))
    lost = [acting.effect.lost(part * acting.strength, command) for part in (low, high)]
    return np.abs((lost[1] - lost[0]) / ((high - low) * acting.strength))


def _found(fit: Fit, etfe: Etfe, recording: Recording, force: Floats) -> tuple[float, float]:
    """How much of a force is left at the motor, and its score."""
    at_lines = Lines.of(etfe, recording)
    added = response_to(fit, COMMAND, at_lines.s) * at_lines(force)
    windows = etfe.spectra.windows(remembered(fit.response), added[None])
    share, sd, freedom = common_coefficient(windows)
    return share, as_normal(abs(share / sd), freedom) if sd > 0 else 0.0
