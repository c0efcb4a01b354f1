r"""How the critical stiffness follows each parameter, at the crossing that binds.

At a crossing h = -1/G(e^{j theta}, p) is real and equal to K.  With a parameter p the angle moves
so that it stays real, and

.. math:: \frac{dK}{dp} = \mathrm{Re} h_p
          - \mathrm{Re} h_\theta \frac{\mathrm{Im} h_p}{\mathrm{Im} h_\theta}.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.models.model import Model
from bayeshaptic.models.parameter import Parameter
from bayeshaptic.shown import Shown, data_frame, listed
from bayeshaptic.stability.binding import BindingCrossing, binding_kinds, group_crossings
from bayeshaptic.stability.crossings import find_crossings, response_of
from bayeshaptic.stability.walls.loops import loops_of
from bayeshaptic.types import Floats

DRAWS = 160
_TURN = 1e-5  # relative, of the angle


@dataclass(frozen=True, eq=False, repr=False)
class Elasticities(Shown):
    """d ln K_CR / d ln p at one of the crossings that may bind.

    Attributes
    ----------
    crossing : BindingCrossing
    names : tuple of str
        The model's parameters, and the delay also where it is known.
    values : ndarray, shape (n, P)
        Draw by draw, of those draws where this crossing binds: per cent of stiffness a per cent of
        the parameter.
    slopes : ndarray, shape (n, P)
        d ln K_CR / d p, a unit of the parameter.
    """

    crossing: BindingCrossing
    names: tuple[str, ...]
    values: Floats = field(repr=False)
    slopes: Floats = field(repr=False)

    def _lines(self) -> tuple[str, ...]:
        ordered = sorted(self.median.items(), key=lambda pair: -abs(pair[1]))
        return (
            f"Elasticities of the limit at the {self.crossing.label}, {len(self.values):,} draws",
            "1 % more of a parameter changes it by:",
            listed(f"{name} {value:+.2g} %" for name, value in ordered),
        )

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a parameter: 5, 50 and 95 per cent of its elasticity."""
        quantiles = np.quantile(self.values, (0.05, 0.5, 0.95), axis=0).T.tolist()
        rows = (
            {"name": name, "q05": low, "q50": middle, "q95": high}
            for name, (low, middle, high) in zip(self.names, quantiles, strict=True)
        )
        return data_frame(rows, "name")

    @property
    def median(self) -> dict[str, float]:
        """Median over the draws, by name."""
        return dict(zip(self.names, np.median(self.values, axis=0).tolist(), strict=True))

    @property
    def slope(self) -> dict[str, float]:
        """Median of d ln K_CR / d p over the draws, by name."""
        return dict(zip(self.names, np.median(self.slopes, axis=0).tolist(), strict=True))

    def interval(self, name: str) -> tuple[float, float]:
        """5 and 95 per cent of the elasticity of the parameter `name`."""
        low, high = np.quantile(self.values[:, self.names.index(name)], (0.05, 0.95))
        return float(low), float(high)


@at_the_door
def elasticities(source: Any, draws: int = DRAWS) -> tuple[Elasticities, ...]:
    """Elasticities of K_CR at each crossing that may bind, the most probable first.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
    draws : int
        About how many are used.

    Returns
    -------
    tuple of Elasticities
        Empty where nothing limits the stiffness.
    """
    loops = loops_of(source, draws=draws)
    model, vectors = with_delay(loops.model, loops.draws)
    system = model.system(vectors)
    found = find_crossings(system, loops.period_s)
    kinds = binding_kinds(system, found.binding_hz, loops.period_s)
    crossings, group = group_crossings(kinds, found.binding_hz)
    usable = np.isfinite(found.critical) & (found.critical > 0)
    slopes = np.full(vectors.shape, np.nan)
    slopes[usable] = _slopes(
        model, vectors[usable], found.binding_hz[usable], found.critical[usable], loops.period_s
    )
    return tuple(
        Elasticities(crossing, model.names, slopes[rows] * vectors[rows], slopes[rows])
        for number, crossing in enumerate(crossings)
        if (rows := np.flatnonzero((group == number) & usable)).size
    )


def with_delay(model: Model, vectors: Floats) -> tuple[Model, Floats]:
    """The model with its delay among the parameters, also where the delay is known.

    Parameters
    ----------
    model : Model
    vectors : ndarray, shape (n, P)

    Returns
    -------
    model : Model
    vectors : ndarray, shape (n, P) or (n, P + 1)
        With the known delay, s, as the last column.
    """
    if "delay_s" not in model.fixed:
        return model, vectors
    left = {name: value for name, value in model.fixed.items() if name != "delay_s"}
    delay = Parameter("delay_s", "time", "loop delay beyond the hold")
    known = np.full((len(vectors), 1), model.fixed["delay_s"])
    whole = replace(model, parameters=(*model.parameters, delay), fixed=left)
    return whole, np.concatenate([vectors, known], axis=1)


def _slopes(
    model: Model, vectors: Floats, frequency_hz: Floats, critical: Floats, period_s: float
) -> Floats:
    """d ln K / d p of each draw at its own crossing, shape (n, P)."""
    theta = 2 * np.pi * frequency_hz * period_s
    before, after = theta * (1 - _TURN), np.minimum(theta * (1 + _TURN), np.pi)
    h_theta = _difference(model, vectors, vectors, before, after, period_s) / (after - before)
    slopes = np.empty(vectors.shape)
    step = 1e-4  # relative, of finite differences
    steps = step * _sizes(model, vectors)
    for column in range(vectors.shape[1]):
        low, high = vectors.copy(), vectors.copy()
        low[:, column] -= steps[:, column]
        high[:, column] += steps[:, column]
        h_p = _difference(model, low, high, theta, theta, period_s) / (2 * steps[:, column])
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = np.where(h_p.imag == 0, 0.0, h_p.imag / h_theta.imag)
        slopes[:, column] = (h_p.real - h_theta.real * turn) / critical
    return slopes


def _sizes(model: Model, vectors: Floats) -> Floats:
    """Magnitudes of the parameters; of one near zero, a part of the largest of its kind."""
    kinds = np.array([parameter.dimension for parameter in model.parameters])
    sizes = np.abs(vectors)
    small = 1e-3
    for kind in np.unique(kinds):
        columns = np.flatnonzero(kinds == kind)
        least = small * sizes[:, columns].max(axis=1, keepdims=True)
        sizes[:, columns] = np.maximum(sizes[:, columns], least)
    return np.maximum(sizes, np.finfo(float).tiny ** 0.5)


def _difference(
    model: Model, low: Floats, high: Floats, at_low: Floats, at_high: Floats, period_s: float
) -> NDArray[np.complex128]:
    """-1/G of one batch minus that of another, each row at its own angle, shape (n,)."""
    every = np.arange(len(low))
    first, last = (
        -1 / response_of(model.system(vectors), period_s).at(every, angle[:, None])[:, 0]
        for vectors, angle in ((low, at_low), (high, at_high))
    )
    return np.asarray(last - first)
