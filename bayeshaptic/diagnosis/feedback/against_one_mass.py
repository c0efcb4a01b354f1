"""What speaks against the limit of one mass that was followed, or against what was given of it."""

from __future__ import annotations

import numpy as np

from bayeshaptic.diagnosis.feedback.in_loop import WORDS, InLoop
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.inference.time_domain.fit import MotionFit
from bayeshaptic.inference.time_domain.mass_in_loop import DELAY, NAMES
from bayeshaptic.inference.time_domain.widths.correlated import SURELY
from bayeshaptic.models import HalfNormal
from bayeshaptic.models.parameter import unit_of
from bayeshaptic.quantities import quantity
from bayeshaptic.stability.critical import CriticalStiffness

_WIDEST_DB = 6.0  # of the limit's 90 % interval: wider, and the priors decide it
WIDE = "the recording leaves the limit open within more than a factor of two"
"""What is said of a limit that `is_wide`."""
_DIMENSIONS = {"m": "mass", "b": "damping", "delay_s": "time"}


def open_questions(
    found: InLoop, posterior: Posterior, limit: CriticalStiffness, one_mass: bool
) -> tuple[str, ...]:
    """What speaks against the limit alone; `one_mass` says that the device was declared to be one.

    Parameters
    ----------
    found : InLoop
    posterior : Posterior
    limit : CriticalStiffness
    one_mass : bool
    """
    reasons = []
    if not one_mass:
        reasons.append(
            f"nothing here shows how the device vibrates above {found.motion.bandwidth_hz:.3g} Hz, "
            "where a vibration mode may set a lower limit than that of one mass"
        )
    model, unsure = posterior.model, _unsure_of_the_delay(found.motion)
    for name, dominated in posterior.prior_dominated.items():
        free = name != "delay_s" or isinstance(model.prior(name), HalfNormal)
        unknown = dominated or (unsure and name == "delay_s")
        if unknown and free and name in WORDS:
            reasons.append(f"the recording says too little of the {WORDS[name]}")
    if is_wide(limit):
        reasons.append(WIDE)
    return tuple(reasons)


def is_wide(limit: CriticalStiffness) -> bool:
    """Whether the limit's 90 % interval is wider than a factor of two."""
    low, high = (limit.quantile(p) for p in (0.05, 0.95))
    return not (low > 0 and 20 * np.log10(high / low) < _WIDEST_DB)


def _unsure_of_the_delay(motion: MotionFit) -> bool:
    """Whether the delay is below zero by chance, as one may be that is known to a period or two."""
    value, sd = motion.values[DELAY], motion.sd[DELAY]
    return bool(value < 0 <= value + SURELY * sd)


def contradictions(motion: MotionFit, posterior: Posterior) -> tuple[str, ...]:
    """What was given, as known or by a prior, and is contradicted by the motion.

    A device file's delay that is not the recording's moves the damping, and with it the limit.
    What was given may be right as well, and the motion be that of more than one mass; that is
    certain where one mass would need what no device has, such as a delay below zero.
    """
    model, drawn = posterior.model, posterior.summary()
    known: list[str] = []
    believed: list[str] = []
    for name, value, sd in zip(NAMES, motion.values, motion.sd, strict=True):
        free = name in model.names
        told = drawn[name]["q50"] if free else model.fixed[name]
        if name not in WORDS or abs(told - value) < SURELY * sd:
            continue
        unit = unit_of(_DIMENSIONS[name], model.force_unit, model.position_unit)
        what = "comes out, with its prior, as" if free else "was given as"
        why = (
            ", which no device has: more than one mass moves, or force and position are not of one "
            "sample"
            if value < 0
            else ": correct what gave it (--device, --delay-s, a prior), or more than one mass "
            "moves"
        )
        (believed if free else known).append(
            f"the {WORDS[name]} {what} {quantity(told, unit)}, and one mass that moves so would "
            f"have {quantity(value, unit, sd)}{why}"
        )
    # What is known wrongly pulls the others along.
    return tuple(known or believed)
