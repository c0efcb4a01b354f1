"""The critical stiffness over one parameter of the design, with the posterior's band."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError
from bayeshaptic.quantities import quantity
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.stability.binding import TITLES, binding_kinds
from bayeshaptic.stability.crossings import find_crossings
from bayeshaptic.stability.draws import vectors_given
from bayeshaptic.stability.guidance.elasticities import with_delay
from bayeshaptic.stability.walls.loops import loops_of
from bayeshaptic.types import Floats

DRAWS = 80
FACTORS = np.geomspace(0.25, 4.0, 25)
_APART = 1.25  # neighbouring points with frequencies further apart are not the same crossing


@dataclass(frozen=True)
class Jump:
    """Where another crossing becomes the most probable one to bind.

    Attributes
    ----------
    value : float
        Of the parameter, between two points of the sweep.
    before, after : str
        What binds below and above, for example "rigid body" and "vibration mode".
    before_hz, after_hz : float
    """

    value: float
    before: str
    after: str
    before_hz: float
    after_hz: float


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Shown):
    """K_CR over one parameter.

    Attributes
    ----------
    name, unit : str
        Of the parameter.
    values : ndarray, shape (V,)
        Of the parameter (its median, times a factor or plus what is added).
    now : float
        Its present median.
    low, middle, high : ndarray, shape (V,)
        5, 50 and 95 per cent of K_CR, in `stiffness_unit`.
    binds : tuple of str
        The most probable binding crossing at each value.
    frequency_hz : ndarray, shape (V,)
        Its median frequency.
    jumps : tuple of Jump
    stiffness_unit : str
    added : bool
        Whether the sweep adds to the parameter.
    """

    name: str
    unit: str
    values: Floats
    now: float
    low: Floats = field(repr=False)
    middle: Floats = field(repr=False)
    high: Floats = field(repr=False)
    binds: tuple[str, ...] = field(repr=False)
    frequency_hz: Floats = field(repr=False)
    jumps: tuple[Jump, ...]
    stiffness_unit: str
    added: bool = False

    def _lines(self) -> tuple[str, ...]:
        ends = (self.values[0], self.values[-1])
        limits = [quantity(float(k), self.stiffness_unit) for k in np.sort(self.middle)[[0, -1]]]
        return (
            f"Sweep of {self.name} from {' to '.join(quantity(float(v), self.unit) for v in ends)}",
            f"now {quantity(self.now, self.unit)}",
            f"limit from {' to '.join(limits)} (medians)",
        )

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a value: K_CR, what binds, its frequency."""
        names = ("values", "low", "middle", "high", "binds", "frequency_hz")
        columns = (getattr(self, name) for name in names)
        return data_frame(dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True))


@at_the_door
def sweep(
    source: Any,
    name: str,
    factors: ArrayLike | None = None,
    add: ArrayLike | None = None,
    draws: int = DRAWS,
) -> Sweep:
    """K_CR against one parameter, all others as the posterior has them.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
    name : str
        Of a parameter of the model; "delay_s" also where it is known.
    factors : array_like, shape (V,), optional
        Multiply the parameter in every draw; by default 25 from a quarter to four times.
    add : array_like, shape (V,), optional
        Add to it instead, in its unit: damping that the device does not have yet.
    draws : int
        About how many are used.

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        If the model has no such parameter, or none of it is a loop: a mass that is not above zero.
    """
    loops = loops_of(source, draws=draws)
    model, vectors = with_delay(loops.model, loops.draws)
    if name not in model.names:
        raise InputError(
            f"no parameter {name} in the {model.name} model; it has {', '.join(model.names)}."
        )
    column = model.names.index(name)
    now = float(np.median(vectors[:, column]))
    steps = _steps(factors, add)
    moved = np.repeat(vectors[None], len(steps), axis=0)
    moved[:, :, column] = (
        moved[:, :, column] * steps[:, None]
        if add is None
        else moved[:, :, column] + steps[:, None]
    )
    system = model.system(vectors_given(model, moved.reshape(-1, model.size)))
    found = find_crossings(system, loops.period_s)
    shape = moved.shape[:2]
    critical, hertz = found.critical.reshape(shape), found.binding_hz.reshape(shape)
    kinds = binding_kinds(system, found.binding_hz, loops.period_s).reshape(shape)
    low, middle, high = np.quantile(critical, (0.05, 0.5, 0.95), axis=1, method="inverted_cdf")
    values = now * steps if add is None else now + steps
    binding = [_most(kinds[i], hertz[i]) for i in range(len(steps))]
    return Sweep(
        name,
        model.unit(name),
        values,
        now,
        low,
        middle,
        high,
        tuple(TITLES[kind] for kind, _ in binding),
        np.array([place for _, place in binding]),
        _jumps(values, binding),
        model.stiffness_unit,
        add is not None,
    )


def _steps(factors: ArrayLike | None, add: ArrayLike | None) -> Floats:
    """The factors, or what is added, in ascending order; by default the usual factors."""
    if factors is not None and add is not None:
        raise InputError("factors and add are both given; give one of them")
    given = FACTORS if factors is None and add is None else factors if add is None else add
    steps = np.sort(np.ravel(np.asarray(given, float)))
    if not steps.size:
        raise InputError(f"{'factors' if add is None else 'add'} is empty; give one number or more")
    return steps


def _most(kinds: NDArray[np.int_], hertz: Floats) -> tuple[int, float]:
    """The most frequent kind of binding crossing, and the median of its frequency."""
    kind = int(np.argmax(np.bincount(kinds, minlength=len(TITLES))))
    mine = hertz[kinds == kind]
    known = mine[np.isfinite(mine)]
    return kind, float(np.median(known)) if len(known) else np.nan


def _jumps(values: Floats, binding: list[tuple[int, float]]) -> tuple[Jump, ...]:
    """Where another kind of crossing, or one at another frequency, becomes the most probable."""
    jumps = []
    for i in range(len(values) - 1):
        (kind, hertz), (after, after_hz) = binding[i], binding[i + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            apart = abs(np.log(np.float64(after_hz) / hertz)) > np.log(_APART)
        if kind != after or apart:
            place = float(0.5 * (values[i] + values[i + 1]))
            jumps.append(Jump(place, TITLES[kind], TITLES[after], hertz, after_hz))
    return tuple(jumps)
