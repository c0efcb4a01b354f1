"""Free or held, this person or another, here or there: a device must be stable in all its cases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.arguments import at_the_door, instance
from bayeshaptic.errors import InputError
from bayeshaptic.models.model import Model
from bayeshaptic.numerics.effective_draws import effective_draws
from bayeshaptic.shown import Shown
from bayeshaptic.stability.critical import CriticalStiffness
from bayeshaptic.stability.draws import MOST_DRAWS
from bayeshaptic.stability.limit_draws import LimitDraws
from bayeshaptic.stability.tail import low_quantile
from bayeshaptic.types import Floats, Ints

GROUPS = FREE, HELD, NEW_PERSON, CONFIGURATION = "free", "held", "new person", "configuration"


@dataclass(frozen=True, eq=False, repr=False)
class Case(Shown):
    """A situation that a device must stay stable in: who holds it, in which configuration.

    Attributes
    ----------
    label : str
        For example "nobody holds it", "user ana", "a new person", "configuration 0.3, held".
    group : {"free", "held", "new person", "configuration"}
    model : Model
    draws : ndarray, shape (n, P)
        Equally weighted, in the order of `model.names`.
    limit : CriticalStiffness
        Of these draws, in the same order; or one that was widened, of draws of its own.
    joint : str or None
        Cases with the same word here are drawn together: their draws of one number belong to one
        another, as those of several configurations of one device.
    user : str or None
        Who was recorded; None for nobody, and for a person not yet seen.
    configuration : float, str or None
        In which; None without any, and where it was predicted.
    """

    label: str
    group: str
    model: Model
    draws: Floats = field(repr=False)
    limit: CriticalStiffness = field(repr=False)
    joint: str | None = None
    user: str | None = None
    configuration: float | str | None = None

    def __post_init__(self) -> None:
        instance("model", self.model, Model, "a Model (see bayeshaptic.grasped)")
        maker = "bayeshaptic.critical_stiffness"
        instance("limit", self.limit, CriticalStiffness, f"a CriticalStiffness (see {maker})")
        if self.group not in GROUPS:
            raise InputError(f"group is {self.group!r}; give one of {', '.join(GROUPS)}")
        shape = np.shape(self.draws)  # a limit that is widened has draws of its own
        if len(shape) != 2 or shape[1] != self.model.size:
            raise InputError(
                f"draws have the shape {shape}; of this model they have {self.model.size} columns, "
                f"{', '.join(self.model.names)}"
            )

    def _lines(self) -> tuple[str, ...]:
        return (
            f"Case: {self.label} ({self.model.name} model, {len(self.draws):,} draws)",
            *self.limit._lines()[:2],
        )


@dataclass(frozen=True)
class Binding:
    """How probable it is that one case sets the device's limit.

    Attributes
    ----------
    case, group : str
        Label and group of the case.
    probability : float
    """

    case: str
    group: str
    probability: float


@dataclass(frozen=True, eq=False)
class DeviceLimit(LimitDraws):
    """The critical stiffness over all cases of a device: in each joint draw, the smallest.

    Attributes
    ----------
    samples : ndarray, shape (n,)
        The smallest K_CR of each joint draw, in `unit`.
    which : ndarray of int, shape (n,)
        Index into `cases` of the case that binds; -1 where nothing limits any of them.
    cases : tuple of Case
    unit : str
    """

    samples: Floats = field(repr=False)
    which: Ints = field(repr=False)
    cases: tuple[Case, ...]
    unit: str

    @property
    def binding(self) -> tuple[Binding, ...]:
        """Every case with its probability of setting the limit, the most probable first."""
        found = [
            Binding(case.label, case.group, float(np.mean(self.which == number)))
            for number, case in enumerate(self.cases)
        ]
        return tuple(sorted(found, key=lambda binding: -binding.probability))

    def by_group(self) -> dict[str, float]:
        """Probability that a case of each group ("free", "held", ...) sets the limit."""
        shares: dict[str, float] = {}
        for binding in self.binding:
            shares[binding.group] = shares.get(binding.group, 0.0) + binding.probability
        return shares

    def safe(self, risk: float) -> float | None:
        """The stiffness that is unstable in some case with probability `risk`.

        As that of one case: a quantile of the draws, or of a tail fitted to the lowest; None where
        they are too few for either.
        """
        found = low_quantile(self.samples, risk, self.effective_at)
        return None if found is None else found.value

    def effective_at(self, stiffness: float) -> float:
        """Effective draws of the share below `stiffness`, by the variances of the cases' shares.

        With F = 1 - prod (1 - F_c) and var F_c = F_c (1 - F_c) / n_c, as many independent draws as
        would give the same variance of F.

        Parameters
        ----------
        stiffness : float
        """
        variance, above = 0.0, 1.0
        for samples, chains in _independent(self.cases):
            below = samples < stiffness
            share = float(below.mean())
            draws = effective_draws(below.reshape(chains, -1))
            above *= 1 - share
            variance += share / (1 - share) / draws if share < 1 else 0.0
        if above in (0.0, 1.0):
            return 0.0 if above == 1.0 else float(len(self.samples))
        risk = 1 - above
        # var F = above^2 sum F_c / ((1 - F_c) n_c), and n = F (1 - F) / var F.
        return risk / (above * variance)


@at_the_door
def device_limit(cases: Sequence[Case], seed: int = 0) -> DeviceLimit:
    """The limit of a device over all its cases.

    Each joint draw takes one draw of every case, in a random order of its own.  Cases that share
    device parameters are so taken as independent, unless they are drawn together.  They depend on
    each other positively (what lowers one limit lowers the others), and then the smallest of
    independent draws is the lower one: the error is on the safe side, and vanishes where one case
    binds.

    Parameters
    ----------
    cases : sequence of Case
    seed : int
        Of the random orders.

    Returns
    -------
    DeviceLimit

    Raises
    ------
    InputError
        Without cases, or where their stiffnesses have different units.
    """
    if not cases:
        raise InputError("no case to take the limit over: none of the recordings could be used.")
    units = sorted({case.limit.unit for case in cases})
    if len(units) > 1:
        raise InputError(
            f"the cases have stiffnesses in {' and '.join(units)}: a study is of one device with "
            "one unit of force and position."
        )
    rng = np.random.default_rng(seed)
    count = min(max(len(case.limit.samples) for case in cases), MOST_DRAWS)
    orders: dict[str, Ints] = {}
    joint = np.empty((len(cases), count))
    for number, case in enumerate(cases):
        order = orders.setdefault(
            case.joint or f"case {number}", _random_order(len(case.limit.samples), count, rng)
        )
        joint[number] = case.limit.samples[order]
    which = np.argmin(joint, axis=0)
    samples = joint[which, np.arange(count)]
    which = np.where(np.isinf(samples), -1, which)
    return DeviceLimit(samples, which, tuple(cases), units[0])


def _random_order(draws: int, count: int, rng: np.random.Generator) -> Ints:
    """`count` numbers of draws in random order, all of them used equally often."""
    rounds = -(-count // draws)
    return np.concatenate([rng.permutation(draws) for _ in range(rounds)])[:count]


def _independent(cases: Sequence[Case]) -> list[tuple[Floats, int]]:
    """Samples and number of chains of every case, those drawn together as the least of them."""
    found: dict[str, tuple[Floats, int]] = {}
    for number, case in enumerate(cases):
        key, samples = case.joint or f"case {number}", case.limit.samples
        if key in found:
            samples = np.minimum(samples, found[key][0])
        found[key] = (samples, case.limit.chains)
    return list(found.values())
