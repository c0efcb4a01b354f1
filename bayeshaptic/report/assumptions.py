"""Everything that a reader must believe in order to believe the report."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING

from bayeshaptic import __version__
from bayeshaptic.models.structures import QUANTITIES
from bayeshaptic.report import words
from bayeshaptic.report.quantities import interval, pretty_unit, pure, quantity

if TYPE_CHECKING:
    from bayeshaptic.diagnosis.analysis import Analysis

LIBRARIES = ("numpy", "scipy", "emcee", "arviz", "matplotlib")


def assumptions(analysis: Analysis) -> tuple[str, ...]:
    """The assumptions in sentences, the data's first."""
    etfe, posterior = analysis.etfe, analysis.posterior
    ensembles, steps, walkers, _ = posterior.chains.shape
    unit = pretty_unit(etfe.force_unit)
    noise = (
        f" Because the model misfits, the posterior takes {pure(analysis.noise_scale)} times that "
        "variance."
        if analysis.noise_scale != 1.0
        else ""
    )
    effects = ", ".join(effect.name for effect in analysis.model.effects)
    return (
        "The device, its configuration and the way it is held are those of the recording: another "
        "person, posture or configuration has another limit.",
        "The wall is a pure stiffness: the commanded force is −K times the sampled position, "
        f"every {quantity(etfe.period_s, 's')}, without virtual damping.",
        "The commanded force is held between samples (zero-order hold). Hold and delay, also a "
        "fraction of a period, are computed exactly, not by a continuous approximation.",
        words.delay(analysis),
        f"The force is in command units ({unit}): a wrong force constant makes masses, dampers and "
        "springs wrong by its factor, but cancels in the stiffness that may be commanded.",
        "The device is linear and does not change during the recording. The limit is that of the "
        "linear part: it holds at amplitudes where dry friction no longer helps.",
        f"Model: {analysis.model.structure.title}; "
        + (f"with {effects}." if effects else "no effect has been added to it."),
        f"Frequencies from {interval(*etfe.band_hz, 'Hz')} decide; outside this band the model "
        "extrapolates.",
        "The noise is Gaussian, with a spectrum that is unknown and smooth: its variance is "
        "estimated in each window of lines and integrated out. The leakage of a random excitation "
        "is removed in each window; what is left over is independent from window to "
        f"window.{noise}",
        "Priors as in the table below. Intervals are 90 % and equal-tailed: from the 5 % to the "
        f"95 % quantile. {ensembles} ensembles of {walkers} walkers, {steps} steps, seed "
        f"{posterior.seed}.",
    )


def priors(analysis: Analysis) -> tuple[tuple[str, str, str], ...]:
    """(name, what it is, prior in words) of every parameter; known ones as such."""
    model = analysis.model
    rows = [
        (p.name, p.title, model.prior(p.name).describe(pretty_unit(model.unit(p.name))))
        for p in model.parameters
    ]
    for name, value in model.fixed.items():
        rows.append((name, QUANTITIES[name][1], f"known: {quantity(value, 's')}"))
    return tuple(rows)


def versions() -> tuple[tuple[str, str], ...]:
    """(name, version) of this package, of Python and of the libraries that made the numbers."""
    found = [("bayeshaptic", __version__), ("Python", platform.python_version())]
    for library in LIBRARIES:
        try:
            found.append((library, version(library)))
        except PackageNotFoundError:
            continue
    return tuple(found)
