"""The section with guidance: shares of the uncertainty, elasticities, sweeps, what to measure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bayeshaptic.inference.next_experiment import Experiment, next_experiment
from bayeshaptic.report.figures.guidance import shares as guidance_shares, sweeps as guidance_sweeps
from bayeshaptic.report.guidance.words import experiment_rows, words
from bayeshaptic.report.page.section import Section, section
from bayeshaptic.stability.guidance.guidance import Guidance, guidance

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis
    from bayeshaptic.stability.cases import Case

FIGURES = ("guidance_shares", "guidance_sweeps")


def guidance_section(case: Case, analysis: Analysis | None, of_several: str = "") -> Section | None:
    """HTML and pictures of the guidance for one case.

    Parameters
    ----------
    case : Case
        One recording, or the case that sets the limit of a device.
    analysis : Analysis, optional
        The recording's: for what to measure next.
    of_several : str
        What the case is called where it is one of several; nothing is said of the others.

    Returns
    -------
    Section or None
        None where hardly any draw has a limit to speak of.
    """
    if np.mean(np.isfinite(case.limit.samples) & (case.limit.samples > 0)) < 0.5:
        return None
    slow = bool(case.model.system(case.draws[:1]).dynamic_links)
    found = guidance(case, slow)
    experiments = () if analysis is None else further_recordings(found, analysis)
    figures: dict[str, tuple[Any, str]] = {
        "guidance_shares": (
            guidance_shares.draw(found),
            "Shares of the uncertainty, and elasticities of the critical stiffness",
        )
    }
    if found.sweeps:
        figures["guidance_sweeps"] = (
            guidance_sweeps.draw(found.sweeps),
            "Critical stiffness over parameters of the design",
        )
    return section(
        "guidance.jinja",
        figures,
        words=words(found, experiments),
        of_several=of_several,
        experiments=experiment_rows(found.shares, experiments),
    )


def further_recordings(found: Guidance, analysis: Analysis) -> Sequence[Experiment]:
    """Predictions for further recordings; none where there is no recording to go by."""
    slopes = [(one.slope, one.crossing.probability) for one in found.elasticities]
    if not slopes:
        return ()
    crossing = found.elasticities[0].crossing.frequency_hz
    return next_experiment(analysis.fit, slopes, crossing, analysis.noise_scale)
