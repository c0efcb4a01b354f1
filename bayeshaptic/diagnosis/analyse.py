"""The analysis of one measurement: fit, sample, find the critical stiffness."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from bayeshaptic.diagnosis.analysis import Analysis
from bayeshaptic.diagnosis.base.alignment import perhaps_early
from bayeshaptic.diagnosis.base.asked import measurement_of
from bayeshaptic.diagnosis.base.begun import Begun, begin, simpler
from bayeshaptic.diagnosis.base.high_passed import TOPIC as HIGH_PASSED, perhaps_high_passed
from bayeshaptic.diagnosis.base.opened import Clock
from bayeshaptic.diagnosis.battery import residual_tests
from bayeshaptic.diagnosis.feedback.units_in_loop import with_units_of
from bayeshaptic.diagnosis.hidden.prior import HiddenPrior
from bayeshaptic.diagnosis.limit_known import SMALL_RISKS, LimitKnown, asked_of_sampler
from bayeshaptic.diagnosis.options import Options, options_from
from bayeshaptic.diagnosis.residuals.overdispersion import noise_scale
from bayeshaptic.diagnosis.state import State
from bayeshaptic.errors import Notice
from bayeshaptic.inference.around_fit import draws_around
from bayeshaptic.inference.fit import Fit
from bayeshaptic.inference.sampler import sample_around
from bayeshaptic.models import Model
from bayeshaptic.quantities import pure
from bayeshaptic.recordings.feedback import is_certain
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.stability.from_etfe import EtfeCriticalStiffness, etfe_critical_stiffness
from bayeshaptic.threads import single_threaded

NO_WITNESS = "feedback biases it"
# Evaluations of the likelihood that one posterior may take.
_MOST_EVALUATIONS = 600_000
_MOST_WITH_LINKS = 200_000  # where dynamic links make each take ten times as long


@single_threaded
def analyse(
    measurement: Recording | Etfe | str | Path,
    model: str | Model = "auto",
    options: Options | None = None,
    **changes: Any,
) -> Analysis:
    """Fit, sample, and find the critical stiffness of one measurement.

    Parameters
    ----------
    measurement : Recording, Etfe or path
        An `Etfe` where there is no recording (a table of a frequency response).
    model : {"auto", "rigid", "free", "grasped"} or Model
        With the option `modes` a chain of masses.
    options : Options, optional
    **changes
        Single options by name: device, delay_s, delay_sd_s, band_hz, prior, held, lever_m, ess,
        seed, progress; see `Options`.

    Returns
    -------
    Analysis

    Raises
    ------
    InputError
        Where the measurement cannot be used, or the model does not fit it in kind.
    """
    chosen = options_from(options, changes)
    HiddenPrior.from_table(chosen.effects)  # refuses names of no effect, as the loop does
    begun = begin(measurement_of(measurement, model, chosen), model, chosen)
    if is_certain(begun.notices):
        return without_sampling(begun, chosen)
    done = finish(begun, begun.etfe, begun.fit, chosen)
    return replace(done, notices=done.notices + _residual_notice(begun))


@single_threaded
def finish(
    begun: Begun,
    etfe: Etfe,
    fit: Fit,
    options: Options,
    small_risks: bool = True,
    witness: EtfeCriticalStiffness | None = None,
    sharper: State | None = None,
) -> Analysis:
    """Sample a fit's posterior and find its critical stiffness.

    Parameters
    ----------
    begun : Begun
    etfe : Etfe
        The measurement's, or what the loop made of it.
    fit : Fit
        Of the base model, or of the model with its effects.
    options : Options
    small_risks : bool
        Whether the stiffness at a small risk is to be known, too.
    witness : EtfeCriticalStiffness, optional
        Of this very measurement, where it is known.
    sharper : State, optional
        Fit and measurement with all leakage known (`diagnosis/base/free_motion.py`), which are
        sampled and told in their place.
    """
    clock = Clock(dict(begun.seconds))
    scale = noise_scale(fit)
    rational = fit.model.system(fit.theta).has_rational_form
    most = _MOST_EVALUATIONS if rational else _MOST_WITH_LINKS
    # A misfit's tail means nothing, and a limit for comparison needs none.
    watch = LimitKnown(fit.model, SMALL_RISKS if small_risks and not fit.misfits else ())
    with clock.stage("sampling"):
        asked = asked_of_sampler(watch, options.within(0.1, 0.8), most)
        sampled, of = (fit, etfe) if sharper is None else (sharper.fit, sharper.etfe)
        posterior = sample_around(_with_noise(sampled, scale), of, asked)
    with clock.stage("critical stiffness"):
        options.report(0.8, "critical stiffness")
        limit = watch.limit_of(posterior)
        etfe_limit = witness or etfe_critical_stiffness(etfe, seed=options.seed, sensor=fit.sensor)
    options.report(0.9, "writing the report")
    notices = begun.notices + perhaps_early(
        replace(begun, etfe=etfe), fit, simpler(begun, fit, options)
    )
    # Asked of the base model before; beside another effect a filter shows once that is there.
    if fit is not begun.fit and all(notice.topic != HIGH_PASSED for notice in notices):
        notices += perhaps_high_passed(fit, etfe, begun.choice, begun.measured.recording)
    if etfe.direct or etfe.through_reference:
        notices = with_units_of(fit, etfe.recording, begun.device, notices)
    return Analysis(
        recording=etfe.recording,
        etfe=of,
        device=begun.device,
        model=posterior.model,  # whose priors know what the fit sees
        choice=begun.choice,
        fit=sampled,
        posterior=posterior,
        limit=limit,
        etfe_limit=etfe_limit,
        notices=notices + limit.notices + _misfit_notice(fit, scale),
        seconds=clock.seconds,
        noise_scale=scale,
        lever_m=begun.lever_m,
    )


def without_sampling(begun: Begun, options: Options) -> Analysis:
    """The analysis of a response that feedback biases: a fit to look at, and no limit.

    Parameters
    ----------
    begun : Begun
    options : Options
    """
    options.report(0.9, "writing the report")
    posterior = draws_around(begun.fit, options.seed)
    limit = critical_stiffness(posterior)
    return Analysis(
        recording=begun.etfe.recording,
        etfe=begun.etfe,
        device=begun.device,
        model=begun.fit.model,
        choice=begun.choice,
        fit=begun.fit,
        posterior=posterior,
        limit=limit,
        etfe_limit=EtfeCriticalStiffness(None, None, None, None, limit.unit, NO_WITNESS),
        notices=begun.notices,
        seconds=begun.seconds,
        lever_m=begun.lever_m,
        sampled=False,
    )


def _with_noise(fit: Fit, scale: float) -> Fit:
    """The fit with `scale` times the noise variance in its windows."""
    windows = replace(fit.windows, scatter=fit.windows.scatter * scale)
    return replace(fit, windows=windows)


def _residual_notice(begun: Begun) -> tuple[Notice, ...]:
    """A warning of what the tests of the residual find, where nobody traces it."""
    found = [test for test in residual_tests(begun.fit, begun.etfe) if test.flagged]
    if not found:
        return ()
    worst = max(found, key=lambda test: test.excess)
    text = (
        f"The residual is not noise: {worst.text} ({worst.family}). Close the loop to find out "
        "what the model lacks; until then its critical stiffness may be far too high."
    )
    return (Notice("warning", "residual", text),)


def _misfit_notice(fit: Fit, scale: float) -> tuple[Notice, ...]:
    if scale == 1.0:
        return ()
    length = scale / fit.reduced_chi_square
    alike = f", and {length:.2g} windows count as one, because their residuals are alike"
    taken = f"The posterior takes that much noise{alike if length > 1.05 else ''}"
    left = (
        f"The residual is {pure(fit.reduced_chi_square**0.5, 2)} times the noise (reduced "
        f"chi-square {pure(fit.reduced_chi_square)})"
    )
    if not fit.misfits:
        text = f"{left}, which so few lines may have by chance. {taken}."
        return (Notice("note", "misfit", text),)
    text = (
        f"{left}: the model lacks something that this device has. {taken}, so that its intervals "
        "are not narrower than the misfit allows, but the misfit is not noise: the critical "
        "stiffness may be wrong by more than its interval."
    )
    return (Notice("warning", "misfit", text),)
