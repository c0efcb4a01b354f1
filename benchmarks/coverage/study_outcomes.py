"""How simulated studies of people came out: a line of a table each, and kept on the disk."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Outcome:
    """How one study came out.

    Attributes
    ----------
    device : str
    means, spreads : ndarray of bool, shape (5,)
        Which means and standard deviations of the population lie in their 90 % intervals.
    covered, below : float
        Share of further people in the predictive interval, and below the 1 % safe stiffness.
    crowd : float
        Share of some thousand further people in the predictive interval, by the model's own
        limits: forty people know the coverage of one study to five points, a crowd knows it.
    users : float
        Share of the users whose critical stiffness lies in their own 90 % interval.
    pull : float
        Of the users' limits: mean of (mean - truth) / sd.
    true_db : (low, high)
        5 and 95 % quantiles of the further people's critical stiffness, dB.
    predicted_db : (low, high)
    pareto_k : float
        The worst recording's.
    seconds : (recordings, population)
    processor_s : float
    """

    device: str
    means: np.ndarray
    spreads: np.ndarray
    covered: float
    below: float
    crowd: float
    users: float
    pull: float
    true_db: tuple[float, float]
    predicted_db: tuple[float, float]
    pareto_k: float
    seconds: tuple[float, float]
    processor_s: float


def row(name: str, outcomes: list[Outcome]) -> str:
    """One line of the table."""
    means = np.mean([one.means for one in outcomes])
    spreads = np.mean([one.spreads for one in outcomes])
    true, predicted = (
        np.mean([getattr(one, field) for one in outcomes], axis=0)
        for field in ("true_db", "predicted_db")
    )
    seconds = np.mean([one.seconds for one in outcomes], axis=0)
    return (
        f"{name:12s} {len(outcomes):3d}   {means:6.1%}  {spreads:6.1%}   "
        f"{np.mean([one.covered for one in outcomes]):6.1%}   "
        f"{np.mean([one.below for one in outcomes]):5.1%}   "
        f"{np.mean([one.crowd for one in outcomes]):6.1%}  "
        f"{np.mean([one.users for one in outcomes]):6.1%}  "
        f"{np.mean([one.pull for one in outcomes]):+5.2f}   "
        f"{true[0]:.2f}..{true[1]:.2f}   {predicted[0]:.2f}..{predicted[1]:.2f}   "
        f"{max(one.pareto_k for one in outcomes):5.2f}   {seconds[0]:4.0f} + {seconds[1]:3.0f}"
        f"   {np.mean([one.processor_s for one in outcomes]):4.0f}"
    )


def kept(folder: Path | None, study: Callable[[], Outcome], device: str, seed: int) -> Outcome:
    """The outcome of a study: from the folder where it is there."""
    if folder is None:
        return study()
    file = folder / f"{device}-{seed}.pickle"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part")
        part.write_bytes(pickle.dumps(study()))
        part.replace(file)
    return pickle.loads(file.read_bytes())
