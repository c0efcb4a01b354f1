"""What drives what: columns exchanged, a sign turned round, a relay, feedback, a velocity."""

from __future__ import annotations

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.quantities import percent
from bayeshaptic.recordings.feedback import OR_NOISE, UNDECIDED
from bayeshaptic.recordings.join import unbroken
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.signals.causality.causality import Causality, causality
from bayeshaptic.recordings.signals.controller import share_by_a_law
from bayeshaptic.recordings.signals.rough_response import RoughResponse

_AGAINST = (
    " The position goes against the force: if this was an open loop, one of them has the opposite "
    "sign; turn it round with --columns, as in position=NAME*-1."
)


def what_drives_what(recording: Recording, rough: RoughResponse, where: str) -> list[Notice]:
    """What drives what; of a measured force, whose past its motion knows better, the sign alone.

    Parameters
    ----------
    recording : Recording
    rough : RoughResponse
        Its own.
    where : str
        How messages begin.
    """
    found = causality(recording)
    measured = recording.sensed is not None and recording.sensed.measured_force
    if measured and not rough.opposite(recording.period_s):
        return []
    if found.swapped and not measured:
        raise _swapped(found, where)
    against = not found.relay and rough.opposite(recording.period_s)
    # A controller opposes the motion, too.
    if measured or found.opposite or (against and not (found.has_feedback or found.doubtful)):
        raise _turned_round(where)
    if found.relay:
        raise _relay(recording, where)
    if found.has_feedback:
        return [_feedback(found.evidence, against, found.far_past)]
    if not measured and (share := share_by_a_law(unbroken(recording))) > 0:
        known = "the positions" if recording.reference is None else "positions and reference"
        law = f"in {percent(share)} of the samples a linear law of {known} makes it exactly"
        return [_feedback(law, against)]
    if found.doubtful:
        return [_doubt(found.evidence, against)]
    own = recording.sensed is None or recording.sensed.derivatives == 0
    if own and rough.is_velocity(recording.period_s) and _pushes_a_velocity(recording):
        raise _velocity(where)
    return [_early()] if found.early_position else []


def _pushes_a_velocity(recording: Recording) -> bool:
    """Whether the force is what changes the position and slows it down, as it is of a velocity.

    A few pulses show the lower frequencies alone, where a spring and a damper look like a damper
    and a mass; but where the force jumps a velocity turns, and a position does not.  Of two devices
    whose pulses looked so 48 and 72 % of the force's power are left; of 26 motors' velocities under
    steps, pulses and noise 2 % at most.
    """
    from scipy.signal import butter, sosfiltfilt

    low = butter(
        2, 0.05, output="sos"
    )  # of half the sampling rate: a few periods of delay are little
    force, velocity = (sosfiltfilt(low, signal) for signal in (recording.force, recording.position))
    columns = np.stack([np.gradient(velocity), velocity, np.ones_like(force)], axis=1)
    columns /= np.linalg.norm(columns, axis=0)
    left = force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    return bool(np.var(left) < 0.3 * np.var(force))


def _swapped(found: Causality, where: str) -> InputError:
    return InputError(
        f"{where}: force and position look swapped: the past position predicts the force (it "
        f"removes {100 * found.removed:.0f} % of the error), the past force does not "
        "predict the position; exchange them with --columns force=...,position=...",
        topic="swapped",
    )


def _turned_round(where: str) -> InputError:
    return InputError(
        f"{where}: the position moves against the force: one of them has the opposite sign, "
        "and the device would have a negative mass; turn one round with --columns, as in "
        "position=NAME*-1",
        topic="swapped",
    )


def _relay(recording: Recording, where: str) -> InputError:
    return InputError(
        f"{where}: a relay recording (the force switches between {recording.force.min():.3g} "
        f"and {recording.force.max():.3g} {recording.force_unit} where the position passes a "
        "set point), of which no frequency response can be estimated; its gain margin is read "
        f"by: bayeshaptic relay {where}",
        topic="relay",
    )


def _velocity(where: str) -> InputError:
    return InputError(
        f"{where}: what should be the position looks like a velocity: a mass with a damper "
        "explains it as its velocity, and not as its position; say so with --columns, as in "
        "velocity=NAME[rad/s], or give the position",
        topic="swapped",
    )


def _feedback(evidence: str, against: bool, far_past: bool = False) -> Notice:
    """That the force was computed from the motion; or may be noise of a band."""
    if far_past:
        text = (
            f"The force was computed from the motion, or is noise of a band ({evidence}, and so "
            "does the force's own far past). Nothing in the recording says which, so it is read as "
            "one of a closed loop, which holds in open loop, too. Noise without a lower edge, as "
            "white noise is, leaves no doubt."
        )
    else:
        text = (
            f"The force was computed from the motion ({evidence}): the recording was made in "
            "closed loop, so the ETFE, the fit and K_CR are biased. Excite the device with a force "
            "that does not depend on the motion. A position that was smoothed with samples yet to "
            "come (filtfilt, splines) knows the force before it acts, and looks the same: then "
            "give the position as it was read."
        )
    text += _AGAINST if against else ""
    return Notice("warning", "feedback", text, (OR_NOISE,) if far_past else ())


def _doubt(evidence: str, against: bool) -> Notice:
    """That it may have been."""
    text = (
        f"It cannot be decided whether the force was computed from the motion ({evidence}, more "
        "than chance but little). If the recording was made in closed loop, the ETFE, the fit and "
        "K_CR are biased: record again with a force that does not depend on the motion, and longer."
    )
    text += _AGAINST if against else ""
    return Notice("warning", "feedback", text, (UNDECIDED,))


def _early() -> Notice:
    text = (
        "The position answers to the force within the same sample: it seems to be recorded "
        "one sample early, and the delay will come out up to one period too short. Pair "
        "each force with the position that was read before it was commanded."
    )
    return Notice("warning", "alignment", text)
