"""K_CR along a configuration coordinate, and the worst configuration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.inference.population.configurations import Configurations, infer_configurations
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.stability.cases import CONFIGURATION, Case
from bayeshaptic.stability.critical import critical_stiffness
from bayeshaptic.types import Floats, Progress


@dataclass(frozen=True, eq=False)
class ConfigurationLimits:
    """K_CR over the configurations between the outermost measured ones.

    Attributes
    ----------
    held : bool
        Whether somebody holds the device.
    coordinates : ndarray, shape (G,)
        Where K_CR is predicted, the measured ones among them.
    measured : ndarray, shape (C,)
    samples : ndarray, shape (n, G)
        K_CR, one joint draw a row.
    unit : str
    cases : tuple of Case
        One a coordinate, drawn together.
    inferred : Configurations
    """

    held: bool
    coordinates: Floats
    measured: Floats
    samples: Floats = field(repr=False)
    unit: str
    cases: tuple[Case, ...] = field(repr=False)
    inferred: Configurations = field(repr=False)

    def quantile(self, p: ArrayLike) -> Any:
        """Quantiles of K_CR at every coordinate, shape (..., G)."""
        return np.quantile(self.samples, np.asarray(p, float), axis=0, method="inverted_cdf")

    @property
    def worst_probability(self) -> Floats:
        """Probability of every coordinate to be the worst of them, shape (G,)."""
        worst = np.argmin(self.samples, axis=1)
        return np.bincount(worst, minlength=len(self.coordinates)) / len(worst)

    @property
    def worst_coordinate(self) -> float:
        """The coordinate that is most probably the worst."""
        return float(self.coordinates[np.argmax(self.worst_probability)])


def configuration_limits(
    posteriors: Sequence[Posterior],
    coordinate: Sequence[float],
    held: bool,
    seed: int = 0,
    progress: Progress | None = None,
) -> ConfigurationLimits:
    """Infer the device along a coordinate, and its critical stiffness.

    Parameters are those of `bayeshaptic.inference.population.configurations.infer_configurations`.
    """
    inferred = infer_configurations(posteriors, coordinate, seed, progress)
    rng = np.random.default_rng(np.random.SeedSequence([seed, int(held)]))
    points = 9
    grid = inferred.grid(points)
    draws = 22_000  # with them 20 lie below the stiffness of 0.1 % risk
    theta = inferred.predict(grid, rng, draws)
    cases = tuple(
        _case(inferred, value, theta[:, number], held) for number, value in enumerate(grid)
    )
    samples = np.stack([case.limit.samples for case in cases], axis=1)
    unit = cases[0].limit.unit
    return ConfigurationLimits(held, grid, inferred.measured, samples, unit, cases, inferred)


def _case(inferred: Configurations, value: float, draws: Floats, held: bool) -> Case:
    who = "held" if held else "nobody holds it"
    between = "" if value in inferred.measured else " (predicted)"
    label = f"configuration {value:.4g}{between}, {who}"
    draws = np.ascontiguousarray(draws)
    limit = critical_stiffness(inferred.model, draws)
    return Case(label, CONFIGURATION, inferred.model, draws, limit, f"along, {who}")
