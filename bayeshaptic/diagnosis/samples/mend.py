"""What encoder, clock and logger did to a recording, and the recording without it.

Nothing here asks whether the model is right: samples are compared with what the samples around them
and the force predict (`prediction`), lines of the spectrum with the lines beside them (`tones`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bayeshaptic.diagnosis.residuals.excess import excess_noise_test
from bayeshaptic.diagnosis.residuals.residual import Test
from bayeshaptic.diagnosis.samples import findings
from bayeshaptic.diagnosis.samples.clipped import clipped
from bayeshaptic.diagnosis.samples.faults import faults
from bayeshaptic.diagnosis.samples.filled import discounted
from bayeshaptic.diagnosis.samples.findings import Finding
from bayeshaptic.diagnosis.samples.jitter import jitter
from bayeshaptic.diagnosis.samples.prediction import as_recorded
from bayeshaptic.diagnosis.samples.repeated import held
from bayeshaptic.diagnosis.samples.resolution import resolution
from bayeshaptic.diagnosis.samples.tones import find_tones
from bayeshaptic.diagnosis.state import State
from bayeshaptic.inference.least_squares import Fit, polish, refine, summarise
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe, compress, estimate_etfe


def measurement_tests(fit: Fit, etfe: Etfe) -> tuple[Test, ...]:
    """A test for each measurement effect, by its name, and one of excess noise.

    None without a recording. Jitter cannot be mended, and stays flagged when it is known.
    """
    if etfe.recording is None:
        return ()
    tests = (finding.test for finding in inspect(etfe.recording, fit, etfe).findings)
    return (*tests, *excess_noise_test(fit, etfe))


def repair_measurement(state: State) -> State:
    """The state with the measurement effects that the samples show, the recording mended.

    Clipped, held, wild and missing samples are filled in from what all others and the force
    predict, tones are subtracted; the ETFE is estimated again in the same band and fitted again.

    Returns
    -------
    State
        The very same where nothing was found.
    """
    recording = state.etfe.recording
    if recording is None:
        return state
    look = inspect(recording, state.fit, state.etfe)
    found = [finding for finding in look.findings if finding.flagged and finding.known]
    known = {effect.name for effect in state.accepted}
    new = tuple(finding.accepted for finding in found if finding.effect.name not in known)
    if new:
        state = replace(state, accepted=(*state.accepted, *new))
    if any(finding.mended for finding in found):
        return _fitted_again(state, look)
    # The recording has another resolution than was thought.
    return replace(state, etfe=replace(state.etfe, recording=look.mended)) if new else state


def _fitted_again(state: State, look: Inspection) -> State:
    """ETFE of the mended recording in the same band, and the fit to it from the current one.

    From the device's own values, too: clipping may have led the current fit far away.
    """
    model, theta = state.model, state.fit.theta
    etfe = estimate_etfe(look.mended, state.etfe.band_hz)
    etfe = discounted(replace(etfe, notices=state.etfe.notices), look.measured)
    nominal = np.array([model.reference.get(name, np.nan) for name in model.names])
    starts = np.stack([theta, np.where(np.isfinite(nominal), nominal, theta)])
    theta, _ = refine(model, compress(etfe), starts)
    for _ in range(2):
        windows = compress(etfe, partial(model.response, theta))
        theta = polish(model, windows, theta)
    return replace(state, etfe=etfe, fit=summarise(model, windows, theta))


@dataclass(frozen=True)
class Inspection:
    """What the samples show.

    Attributes
    ----------
    findings : list of Finding
    mended : Recording
        Without what could be mended.
    measured : float
        Share of its samples that was not filled in.
    """

    findings: list[Finding]
    mended: Recording
    measured: float


def inspect(recording: Recording, fit: Fit, etfe: Etfe) -> Inspection:
    """Look at every sample and every line, and mend what is wrong.

    In this order, because each hides the next: clipping, held samples, missing rows, jitter, wild
    samples, tones.
    """
    samples, unit = as_recorded(recording), recording.position_unit
    counts = resolution(samples, etfe)
    coarse = findings.of_resolution(counts, unit)
    wrong, statistic = clipped(samples)
    cut = findings.of_clipping(recording, wrong, statistic)
    if not cut.known:  # there is nothing to look at
        return Inspection([coarse, cut], recording, 1.0)
    samples = samples.without(wrong)
    wrong, statistic = held(samples)
    repeated = findings.of_held(wrong, statistic)
    if repeated.flagged:
        samples = samples.without(wrong)
    faulty = faults(samples)
    missing = findings.of_missing(faulty)
    samples = faulty.samples
    late = findings.of_jitter(jitter(samples), recording.period_s)
    if late.flagged:  # then samples far off are not wild
        faulty = replace(faulty, wild_score=0.0)
    wild = findings.of_wild(faulty)
    if wild.flagged:
        samples = samples.without(faulty.wild)
    mended = samples.mended
    lines = find_tones(mended, etfe.band_hz, fit.response)
    humming = findings.of_tones(lines, unit)
    found = [coarse, cut, repeated, missing, late, wild, humming]
    count = counts.count if coarse.flagged else recording.encoder_resolution
    mended = replace(mended, position=lines.taken_off(mended), encoder_resolution=count)
    measured = getattr(etfe.spectra, "measured", 1.0) * (1 - float(samples.missing.mean()))
    return Inspection(found, mended, measured)
