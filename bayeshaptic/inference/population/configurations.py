"""A device along a configuration coordinate: the carriage's position, an arm's angle."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bayeshaptic.errors import InputError, Notice
from bayeshaptic.inference.coordinates import Coordinates
from bayeshaptic.inference.population.gaussian_likelihood import gaussian_likelihood
from bayeshaptic.inference.population.infer import common_model, prior_moments, study_coordinates
from bayeshaptic.inference.population.reweighting import inside
from bayeshaptic.inference.population.sampler import LevelChains, sample_level
from bayeshaptic.inference.population.settling import astray, settled_nearby
from bayeshaptic.inference.population.trend import Trend
from bayeshaptic.inference.posterior import Posterior
from bayeshaptic.models import Model
from bayeshaptic.models.structures import HAND
from bayeshaptic.progress import silent
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, Progress

FEWEST = 3  # configurations from which one is predicted between them


@dataclass(frozen=True)
class Configurations:
    """Posterior of a device's parameters along a coordinate.

    Attributes
    ----------
    measured : ndarray, shape (C,)
        Coordinates that were measured, in order, each once.
    model : Model
        The model that all recordings were fitted with, P parameters.
    chains : LevelChains
        Of the amplitudes, the scatters and the length.
    notices : tuple of Notice
    """

    measured: Floats
    model: Model = field(repr=False)
    chains: LevelChains = field(repr=False)
    notices: tuple[Notice, ...] = ()
    _path: Trend | None = field(default=None, repr=False)
    _here: Coordinates | None = field(default=None, repr=False)

    def grid(self, points: int) -> Floats:
        """Coordinates from the lowest measured one to the highest, all measured ones among them.

        Parameters
        ----------
        points : int
            How many there would be, evenly spaced.  Those that lie near a measured coordinate make
            room for it.

        Returns
        -------
        ndarray, shape (G,)
            In order, nearly `points` of them.
        """
        even = np.linspace(self.measured[0], self.measured[-1], points)
        gap = np.ptp(self.measured) / (points - 1)
        near = np.abs(even[:, None] - self.measured).min(axis=1) < 0.4 * gap
        return np.sort(np.concatenate([even[~near], self.measured]))

    def predict(self, coordinate: Floats, rng: np.random.Generator, count: int) -> Floats:
        """Draw the parameters along the coordinate, jointly for all its values.

        Paths on which a damper would be negative are thrown away.  Where fewer than one in five
        are left, they are mirrored at zero instead.

        Parameters
        ----------
        coordinate : ndarray, shape (G,)
            Where to predict, in the unit of `measured`.
        rng : numpy.random.Generator
        count : int
            Number of draws.

        Returns
        -------
        ndarray, shape (count, G, P)
            Natural values in the order of `model.names`.
        """
        assert self._path is not None and self._here is not None
        low = self._here.lowest
        parts: list[Floats] = []
        mirrored = False
        batch = 2000
        rare = 0.2
        while sum(map(len, parts)) < count:
            x = self._path.draw(self.chains.thinned(batch, rng), coordinate, rng)
            good = np.all(x >= low, axis=(1, 2))
            # Paths on which no damper is negative; where there are hardly any, mirrored at zero.
            mirrored = mirrored or (not parts and good.mean() < rare)
            parts.append(x if mirrored else x[good])
        found = np.concatenate(parts)[:count]
        flat = inside(found.reshape(-1, self.model.size), self._here)
        return self._here.natural(flat).reshape(count, len(coordinate), -1)


@single_threaded
def infer_configurations(
    posteriors: Sequence[Posterior],
    coordinate: Sequence[float],
    seed: int = 0,
    progress: Progress | None = None,
) -> Configurations:
    """Infer how the parameters change along a configuration coordinate.

    Parameters
    ----------
    posteriors : sequence of Posterior
        One a recording, of models with the same parameters.
    coordinate : sequence of float
        Of each recording, in any unit.
    seed : int
    progress : callable, optional
        Called with the share done and a word about it.

    Returns
    -------
    Configurations

    Raises
    ------
    InputError
        With fewer than three different configurations, another number of coordinates than of
        posteriors, posteriors of models with different parameters, or a recording that cannot be
        described beside the others.
    """
    report = progress or silent
    measured = _places(posteriors, coordinate)
    model = common_model(posteriors)
    here = study_coordinates(model, posteriors)
    own = tuple(gaussian_likelihood(one, here) for one in posteriors)
    hand = np.isin(model.names, HAND)
    path = Trend(own, np.asarray(coordinate, float), hand, *prior_moments(model, here))
    tune, run, rest = np.random.SeedSequence(seed).spawn(3)
    report(0.0, "configurations: first look")
    path = settled_nearby(path, own, posteriors, here, path.guess()[0])
    first_steps = 200
    chains = sample_level(path, tune, steps=first_steps)
    report(0.5, "configurations: sampling")
    again = np.random.default_rng(rest)
    middle = np.median(chains.thinned(1000, again), axis=0)
    path = settled_nearby(path, own, posteriors, here, middle)
    chains = sample_level(path, run, chains)
    lost = astray(path, posteriors, here, np.median(chains.thinned(1000, again), axis=0))
    if lost:
        where = ", ".join(f"{coordinate[number]:g}" for number in lost)
        raise InputError(
            f"what is recorded in configuration {where} leaves too much open to be on one curve "
            "with the others."
        )
    notices = (*chains.notices, *_of_few_places(measured, model))
    return Configurations(measured, model, chains.resting(), notices, path, here)


def _places(posteriors: Sequence[Posterior], coordinate: Sequence[float]) -> Floats:
    """The different configurations in their order, refused where they are too few."""
    if len(coordinate) != len(posteriors):
        raise InputError(
            f"{len(posteriors)} posteriors, but {len(coordinate)} configurations: give one each."
        )
    measured = np.unique(np.asarray(coordinate, float))
    if len(measured) < FEWEST:
        raise InputError(
            f"{len(measured)} different configurations cannot say how the device changes between "
            f"them; record at least {FEWEST}."
        )
    return measured


def _of_few_places(measured: Floats, model: Model) -> tuple[Notice, ...]:
    """That the curve between so few is a guess as much as a finding."""
    if len(measured) >= 5:
        return ()
    who = "held" if any(name in HAND for name in model.names) else "nobody holding it"
    text = (
        f"{len(measured)} configurations ({who}) say little about what is between them. How "
        "fast the device changes there is the prior's guess as much as a finding."
    )
    return (Notice("note", "configurations", text),)
