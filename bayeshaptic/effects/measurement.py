"""Effects of encoder, clock, logger and bystanders: the data change, the device does not.

They have no parameters in the model. `bayeshaptic.diagnosis.samples.mend` finds them in the samples
and, where that can be done, mends the recording.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from bayeshaptic.effects.registry import register


@dataclass(frozen=True)
class MeasurementEffect:
    """What is wrong with a measurement, by name.

    What cannot be `mended` stays in the recording, as noise.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    family: ClassVar[str] = "measurement"
    mended: ClassVar[bool] = True
    ties: ClassVar[tuple[str, ...]] = ()
    told_apart_by: ClassVar[str] = ""


@register
class Quantisation(MeasurementEffect):
    """Positions in counts coarser than declared: more noise, and a lower quantisation limit."""

    name = "quantisation"
    title = "coarse resolution of the position"
    mended = False


@register
class MainsTone(MeasurementEffect):
    """A sinusoid in the position, of the mains or of something that turns."""

    name = "mains_tone"
    title = "tone in the position"
    told_apart_by = (
        "where it enters: a recording with the amplifier on and no excitation, and one with it off"
    )


@register
class HeldSamples(MeasurementEffect):
    """Positions written down twice, because a new one came too late."""

    name = "held_samples"
    title = "held samples of the position"


@register
class PositionClipping(MeasurementEffect):
    """Positions cut off at the end of the sensor's range."""

    name = "position_clipping"
    title = "clipped position"


@register
class SampleJitter(MeasurementEffect):
    """Positions read early or late: noise that rises with the speed."""

    name = "sample_jitter"
    title = "jitter of the sampling instants"
    mended = False


@register
class DroppedSamples(MeasurementEffect):
    """Rows that never reached the file, and left no trace in the time stamps."""

    name = "dropped_samples"
    title = "missing rows"


@register
class WildSamples(MeasurementEffect):
    """Single positions that are wrong."""

    name = "wild_samples"
    title = "single wild samples of the position"


@register
class OutsideForce(MeasurementEffect):
    """Moments in which a bump or a touch moved the device, or its command did not arrive."""

    name = "outside_force"
    title = "force from outside for a moment"
    told_apart_by = "who or what was beside the device then, and what the amplifier sent"
