"""What the tests of the samples found, in words and numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.diagnosis import thresholds
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.samples.faults import Faults
from bayeshaptic.diagnosis.samples.jitter import Jitter
from bayeshaptic.diagnosis.samples.outside import Outside
from bayeshaptic.diagnosis.samples.prediction import Bools
from bayeshaptic.diagnosis.samples.resolution import Resolution
from bayeshaptic.diagnosis.samples.sinusoids import Tones, in_words
from bayeshaptic.diagnosis.state import Accepted, Estimate
from bayeshaptic.effects.measurement import (
    DroppedSamples,
    HeldSamples,
    MainsTone,
    MeasurementEffect,
    OutsideForce,
    PositionClipping,
    Quantisation,
    SampleJitter,
    WildSamples,
)
from bayeshaptic.quantities import quantity
from bayeshaptic.recordings.recording import Recording


@dataclass(frozen=True)
class Finding:
    """The result of one test of the samples.

    Attributes
    ----------
    effect : type of MeasurementEffect
        What it means where it is flagged.
    statistic, threshold : float
    text : str
    estimates : mapping
    known : bool
        Whether it is understood; otherwise the test stays flagged.
    frequency_hz : float or None
    """

    effect: type[MeasurementEffect]
    statistic: float
    threshold: float
    text: str
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    known: bool = True
    frequency_hz: float | None = None

    @property
    def flagged(self) -> bool:
        return self.test.flagged

    @property
    def mended(self) -> bool:
        """Whether the recording can be mended."""
        return self.effect.mended

    @property
    def test(self) -> Test:
        name = self.effect.name
        return Test(
            name, "measurement", self.statistic, self.threshold, self.frequency_hz, self.text
        )

    @property
    def accepted(self) -> Accepted:
        effect = self.effect
        return Accepted(
            effect.name,
            effect.title,
            effect.family,
            self.text,
            self.estimates,
            ties=effect.ties,
            told_apart_by=effect.told_apart_by,
        )


def of_resolution(found: Resolution, unit: str) -> Finding:
    """Counts coarser than declared."""
    text = "the positions are not multiples of anything"
    if found.count:
        text = f"the positions are multiples of {quantity(found.count, unit)}"
        if found.declared:
            text += f" where {quantity(found.declared, unit)} were declared"
    estimates = {"resolution": Estimate(found.count, 0.0, unit)}
    return Finding(Quantisation, found.statistic, thresholds.RESOLUTION, text, estimates)


def of_clipping(recording: Recording, wrong: Bools, statistic: float) -> Finding:
    """Samples at the end of the sensor's range."""
    unit, estimates = recording.position_unit, {"share": _share(wrong)}
    text = "no position is cut off at an extreme"
    if np.isinf(statistic):
        text = "nearly all positions stay at an extreme: too few are left to find the device"
    if wrong.any():
        limits = np.unique(recording.position[wrong])
        where = " and ".join(f"{limit:.4g}" for limit in limits)
        text = (
            f"{100 * wrong.mean():.2g} % of the positions stay at {where} {unit} where the motion "
            "led beyond; they were filled in"
        )
        for number, limit in enumerate(limits, 1):
            estimates[f"limit_{number}"] = Estimate(float(limit), 0.0, unit)
    return Finding(
        PositionClipping,
        statistic,
        thresholds.CLIPPED,
        text,
        estimates,
        known=bool(np.isfinite(statistic)),
    )


def of_held(wrong: Bools, statistic: float) -> Finding:
    """Samples that repeat the one before."""
    text = "no position repeats the one before where the device moved on"
    if wrong.any():
        text = (
            f"{wrong.sum()} positions ({100 * wrong.mean():.2g} %) repeat the one before although "
            "the device moved on; they were filled in"
        )
    return Finding(HeldSamples, statistic, thresholds.HELD, text, {"share": _share(wrong)})


def of_missing(found: Faults) -> Finding:
    """Rows that are not there."""
    count = found.samples.recording.samples
    text = "no row is missing"
    if found.lost:
        text = f"{found.lost} rows are missing in places where the motion jumps; they were put back"
    share = Estimate(found.lost / count, np.sqrt(found.lost) / count, "")
    return Finding(DroppedSamples, float(found.lost), thresholds.LOST, text, {"share": share})


def of_wild(found: Faults) -> Finding:
    """Samples that are far off."""
    count = int(found.wild.sum())
    text = f"{count} single positions are far off; they were filled in"
    if count == 1:
        text = "a single position is far off; it was filled in"
    return Finding(
        WildSamples, found.wild_score, thresholds.WILD, text, {"share": _share(found.wild)}
    )


def of_outside(found: Outside, recording: Recording) -> Finding:
    """Moments in which something else moved the device."""
    text, estimates = "nothing else than the command moved the device for a moment", {}
    if found.moments:
        clock = recording.period_s
        spans = [(clock * moment.start, clock * moment.stop) for moment in found.moments]
        times = ", ".join(f"{begin:.2f} to {end:.2f} s" for begin, end in spans)
        text = (
            f"from {times} something else moved the device, or the command did not arrive; what "
            "pushed was added to the command"
        )
        estimates["share"] = _share(found.acts)
        for number, (begin, end) in enumerate(spans, 1):
            estimates[f"begin_{number}_s"] = Estimate(begin, 0.0, "s")
            estimates[f"end_{number}_s"] = Estimate(end, 0.0, "s")
    return Finding(OutsideForce, found.statistic, thresholds.OUTSIDE, text, estimates)


def of_jitter(found: Jitter, period_s: float) -> Finding:
    """Samples off their time."""
    text = "the noise does not rise with the speed as that of samples off their time would"
    if found.score > 0:
        text = (
            f"the noise rises with the speed: samples are off their time by {found.sd_s:.2g} s "
            f"({100 * found.sd_s / period_s:.2g} % of the period)"
        )
    estimates = {"sd_s": Estimate(found.sd_s, found.sd_sd_s, "s")}
    return Finding(SampleJitter, found.score, found.threshold, text, estimates)


def of_tones(found: Tones, unit: str) -> Finding:
    """Lines far above their neighbours."""
    text = "no line of the spectrum is far above its neighbours"
    estimates, tones = {}, found.apart()
    if tones:
        words = in_words(tones, unit)
        text = f"far above the lines beside them: {words}; they were subtracted"
    for number, tone in enumerate(tones, 1):
        estimates[f"frequency_{number}_hz"] = Estimate(
            tone.frequency_hz, tone.frequency_sd_hz, "Hz"
        )
        estimates[f"amplitude_{number}"] = Estimate(abs(tone.amplitude), tone.amplitude_sd, unit)
    where = tones[0].frequency_hz if tones else None
    return Finding(
        MainsTone, found.score, thresholds.LOG_CHANCE, text, estimates, frequency_hz=where
    )


def _share(wrong: Bools) -> Estimate:
    return Estimate(float(wrong.mean()), 0.0, "")
