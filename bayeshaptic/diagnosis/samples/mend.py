"""What encoder, clock and logger did to a recording, and the recording without it.

Nothing here asks whether the model is right: samples are compared with what the samples around them
and the force predict (`prediction`), lines of the spectrum with the lines beside them (`tones`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.samples import findings
from bayeshaptic.diagnosis.samples.clipped import clipped
from bayeshaptic.diagnosis.samples.faults import faults
from bayeshaptic.diagnosis.samples.filled import discounted
from bayeshaptic.diagnosis.samples.findings import Finding
from bayeshaptic.diagnosis.samples.jitter import jitter
from bayeshaptic.diagnosis.samples.outside import outside
from bayeshaptic.diagnosis.samples.prediction import Samples, as_recorded
from bayeshaptic.diagnosis.samples.repeated import held
from bayeshaptic.diagnosis.samples.resolution import resolution
from bayeshaptic.diagnosis.samples.slow_push import slow_push
from bayeshaptic.diagnosis.samples.tones import find_tones
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.least_squares import least_squares
from bayeshaptic.inference.screening import starting_bases
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe

_SLOWER = 2  # fits with more of what pushed the device slowly, each by the one before


def measurement_tests(fit: Fit, etfe: Etfe, look: SampleLook | None = None) -> tuple[Test, ...]:
    """A test for each measurement effect, by its name.

    None without a recording. Jitter cannot be mended, and stays flagged when it is known.

    Parameters
    ----------
    fit : Fit
    etfe : Etfe
    look : SampleLook, optional
        What the samples showed, where they were looked at before.
    """
    if etfe.unbroken is None:
        return ()
    return tuple(finding.test for finding in inspect(etfe.unbroken, fit, etfe, look).findings)


def repair_measurement(state: State, look: SampleLook | None = None) -> State:
    """The state with the measurement effects that the samples show, the recording mended.

    Clipped, held, wild and missing samples are filled in from what all others and the force
    predict, what else moved the device is added to its command, tones are subtracted; the ETFE is
    estimated again in the same band and fitted again.

    Returns
    -------
    State
        The very same where nothing was found.
    """
    recording = state.etfe.unbroken
    if recording is None:
        return state
    found = inspect(recording, state.fit, state.etfe, look)
    sure = [finding for finding in found.findings if finding.flagged and finding.known]
    known = {effect.name for effect in state.accepted}
    new = tuple(finding.accepted for finding in sure if finding.effect.name not in known)
    if new:
        state = replace(state, accepted=(*state.accepted, *new))
    if any(finding.mended for finding in sure):
        return _fitted_again(state, found)
    # The recording has another resolution than was thought.
    return replace(state, etfe=replace(state.etfe, recording=found.mended)) if new else state


def _fitted_again(state: State, found: Inspection) -> State:
    """ETFE of the mended recording in the same band, and the fit to it from the current one.

    From the device's own values, too: clipping may have led the current fit far away.
    """
    fit, mended = state.fit, found.mended

    def estimated() -> Etfe:
        etfe = replace(estimate_etfe(mended, state.etfe.band_hz), notices=state.etfe.notices)
        return discounted(etfe, found.measured)

    starts = starting_bases(fit.model, fit.theta, fit.elsewhere)
    etfe = estimated()
    fit = least_squares(fit.model, etfe, start=starts)
    for _ in range(_SLOWER if found.moments else 0):
        slow = slow_push(fit, etfe, mended, found.moments)
        mended = replace(mended, force=mended.force + slow)
        etfe = estimated()
        fit = least_squares(fit.model, etfe, start=fit.theta)
    return replace(state, etfe=etfe, fit=fit)


@dataclass(frozen=True)
class SampleLook:
    """What the samples show without any model; tones are looked for beside a model's resonances.

    Attributes
    ----------
    recording : Recording
        That was looked at.
    findings : tuple of Finding
    samples : Samples or None
        With what is wrong among them marked; None where nothing can be looked at.
    resolution : float or None
        Counts of the position, as far as they are known.
    measured : float
        Share of the samples whose position and force are as they were recorded.
    moments : tuple of slice
        In which something else moved the device.
    """

    recording: Recording
    findings: tuple[Finding, ...]
    samples: Samples | None
    resolution: float | None
    measured: float = 1.0
    moments: tuple[slice, ...] = ()

    @property
    def wrong(self) -> bool:
        """Whether there are samples to mend."""
        return any(finding.flagged and finding.mended for finding in self.findings)

    def holds_for(self, recording: Recording) -> bool:
        """Whether it says as much of this recording: the same one, less what a force adds.

        What a force adds is smooth: it makes no sample wrong, and hides none that is.
        """
        return recording is self.recording or not self.wrong


@dataclass(frozen=True)
class Inspection:
    """What samples and lines show.

    Attributes
    ----------
    findings : list of Finding
    mended : Recording
        Without what could be mended.
    measured : float
        Share of its samples that are as they were recorded.
    moments : tuple of slice
        In which a force that was found was added to the command.
    """

    findings: list[Finding]
    mended: Recording
    measured: float
    moments: tuple[slice, ...] = ()


def look_at_samples(recording: Recording, etfe: Etfe) -> SampleLook:
    """Look at every sample, and mark what is wrong.

    In this order, because each hides the next: clipping, held samples, missing rows, what else
    moved the device, jitter, wild samples.
    """
    samples = as_recorded(recording)
    counts = resolution(samples, etfe)
    coarse = findings.of_resolution(counts, recording.position_unit)
    count = counts.count if coarse.flagged else recording.encoder_resolution
    wrong, statistic = clipped(samples)
    cut = findings.of_clipping(recording, wrong, statistic)
    if not cut.known:  # there is nothing to look at
        return SampleLook(recording, (coarse, cut), None, count)
    samples = samples.without(wrong)
    wrong, statistic = held(samples)
    repeated = findings.of_held(wrong, statistic)
    if repeated.flagged:
        samples = samples.without(wrong)
    faulty = faults(samples)
    missing = findings.of_missing(faulty)
    samples = faulty.samples
    besides = outside(samples.without(faulty.wild))
    moved = findings.of_outside(besides, recording)
    if moved.flagged:
        own = samples.recording
        samples = replace(samples, recording=replace(own, force=own.force + besides.force))
    late = findings.of_jitter(jitter(samples), recording.period_s)
    if late.flagged:  # then samples far off are not wild
        faulty = replace(faulty, wild_score=0.0)
    wild = findings.of_wild(faulty)
    if wild.flagged:
        samples = samples.without(faulty.wild)
    found = (coarse, cut, repeated, missing, moved, late, wild)
    measured = 1 - float(np.mean(samples.missing | besides.acts))
    return SampleLook(recording, found, samples, count, measured, besides.moments)


def inspect(
    recording: Recording, fit: Fit, etfe: Etfe, look: SampleLook | None = None
) -> Inspection:
    """Look at every sample and at every line, and mend what is wrong.

    `look` is what the samples showed before: that does not depend on the model, and costs more than
    all other tests together.
    """
    own = look if look and look.holds_for(recording) else look_at_samples(recording, etfe)
    if own.samples is None:
        return Inspection(list(own.findings), recording, 1.0)
    mended = own.samples.mended if own.wrong else recording
    lines = find_tones(mended, etfe.band_hz, fit.response)
    humming = findings.of_tones(lines, recording.position_unit)
    mended = replace(mended, position=lines.taken_off(mended), encoder_resolution=own.resolution)
    measured = getattr(etfe.spectra, "measured", 1.0) * own.measured
    return Inspection([*own.findings, humming], mended, measured, own.moments)
