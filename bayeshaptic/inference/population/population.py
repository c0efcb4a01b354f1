"""A population of users: the posterior of their hands, and of the device that they held."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bayeshaptic.errors import Notice
from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.population.below import Below
from bayeshaptic.inference.population.hierarchy import Hierarchy
from bayeshaptic.inference.population.reweighting import Reweighted, inside
from bayeshaptic.inference.population.sampler import LevelChains
from bayeshaptic.models import Model
from bayeshaptic.quantities import estimate
from bayeshaptic.shown import Shown, data_frame, listed
from bayeshaptic.types import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Population(Shown):
    """Posterior of a population of hands, and of the device that they held.

    Attributes
    ----------
    parameters : tuple of str
        Names of the hand's parameters, H of them.
    log_mean, log_sd : ndarray, shape (n, H)
        Of the logarithms over people, in n draws of the population.
    correlation : ndarray, shape (n, H, H)
        Of the logarithms over people.
    users : tuple of str
    places : tuple
        Configurations that people were measured in; (None,) without.
    model : Model
        The model that all recordings were fitted with, P parameters.
    recordings : tuple of Reweighted
        Every recording's parameters given all recordings, in the order that they came.
    notices : tuple of Notice
        What a reader should know: chains that have not converged, recordings left by themselves.
    seconds : float
        How long it took.
    chains : LevelChains or None
        Of the spreads and correlations, with what it takes to trust them.
    walkers : int
        Number of chains that the draws consist of, one after the other.
    """

    parameters: tuple[str, ...]
    log_mean: Floats = field(repr=False)
    log_sd: Floats = field(repr=False)
    correlation: Floats = field(repr=False)
    users: tuple[str, ...]
    places: tuple[float | str | None, ...]
    model: Model = field(repr=False)
    recordings: tuple[Reweighted, ...] = field(repr=False)
    notices: tuple[Notice, ...] = ()
    seconds: float = 0.0
    chains: LevelChains | None = field(default=None, repr=False)
    walkers: int = 1
    _here: Coordinates | None = field(default=None, repr=False)
    _hierarchy: Hierarchy | None = field(default=None, repr=False)
    _below: Below | None = field(default=None, repr=False)

    def _lines(self) -> tuple[str, ...]:
        low, middle, high = np.quantile(np.exp(self.log_mean), (0.05, 0.5, 0.95), axis=0)
        typical = (
            f"{name} {estimate(m, a, b, self.model.unit(name))}"
            for name, a, m, b in zip(self.parameters, low, middle, high, strict=True)
        )
        spread = (
            f"{name} {100 * sd:.0f} %"
            for name, sd in zip(self.parameters, np.median(self.log_sd, axis=0), strict=True)
        )
        return (
            f"Population of {len(self.users)} people in {len(self.recordings)} recordings",
            f"typical person: {listed(typical, 3)}",
            f"people differ by {listed(spread)}",
        )

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a parameter: the typical person, how much people differ."""
        levels = {"q05": 0.05, "q50": 0.5, "q95": 0.95}
        rows = (
            {"parameter": name, "unit": self.model.unit(name)}
            | {f"typical_{q}": np.exp(np.quantile(mean, p)) for q, p in levels.items()}
            | {f"log_sd_{q}": np.quantile(sd, p) for q, p in levels.items()}
            for name, mean, sd in zip(self.parameters, self.log_mean.T, self.log_sd.T, strict=True)
        )
        return data_frame(rows, "parameter")

    @property
    def device_parameters(self) -> tuple[str, ...]:
        """Names of the parameters that all recordings share up to a small spread."""
        return tuple(name for name in self.model.names if name not in self.parameters)

    @property
    def device_spread(self) -> Floats:
        """Spread between recordings: of logarithms, or in prior widths; shape (n, D - H)."""
        assert self._below is not None
        return self._below.level.device_sd

    def of_user(self, user: str) -> tuple[Reweighted, ...]:
        """The recordings of one user, by the name in `users`; none for another name."""
        return tuple(one for one in self.recordings if one.user == user)

    def new_person(self, rng: np.random.Generator, each: int = 1, place: int = 0) -> Floats:
        """Parameters of people not yet seen: `each` from every draw of the population.

        Parameters
        ----------
        rng : numpy.random.Generator
        each : int
            People a draw of the population; draw after draw.
        place : int
            Index into `places`.

        Returns
        -------
        ndarray, shape (n * each, P)
            Natural values in the order of `model.names`.
        """
        assert self._here is not None and self._hierarchy is not None and self._below is not None
        hierarchy, level = self._hierarchy, self._below.level
        count, hand = self.log_mean.shape
        x = np.empty((count, each, self.model.size))
        normal = rng.standard_normal((count, each, self.model.size))
        root = level.hand_sd[:, :, None] * level.correlation_root
        people = np.einsum("nij,nej->nei", root, normal[..., :hand])
        trial = level.trial_sd[:, None, None] * rng.standard_normal(people.shape)
        x[:, :, hierarchy.hand] = self.log_mean[:, None] + people + trial
        device = len(hierarchy.device)
        start = hand + place * device
        middle = self._below.beta[:, None, start : start + device]
        x[:, :, hierarchy.device] = middle + level.device_sd[:, None] * normal[..., hand:]
        return self._here.natural(inside(x.reshape(-1, self.model.size), self._here))
