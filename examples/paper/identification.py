"""Tables I and II identified back from simulated experiments of 30 s of white noise."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from bayeshaptic.inference import Fit, Posterior, least_squares, sample
from bayeshaptic.models import build_model
from bayeshaptic.recordings import recording_from_arrays
from bayeshaptic.recordings.recording import Recording
from bayeshaptic.recordings.response.estimate import estimate_etfe
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.rig import Bench, SimulatedRecording, simulate
from bayeshaptic.stability import CriticalStiffness, critical_stiffness

from .published import CASES, LEVER_M, TABLES, values

SEED = 2010
RIGID_BAND_HZ = (0.7, 20.0)  # well below the first mode
# What of the hand has a value at the tip, and what it is called in the data file.
AT_TIP = {"mh": "mh_kg", "bh": "bh_ns_per_m", "kh": "kh_n_per_m"}


@dataclass(frozen=True)
class Identified:
    """A device identified from one simulated experiment."""

    case: tuple[str, str]
    etfe: Etfe = field(repr=False)
    fit: Fit = field(repr=False)
    posterior: Posterior = field(repr=False)
    limit: CriticalStiffness = field(repr=False)

    @property
    def rows(self) -> list[Row]:
        """One a parameter."""
        published = values(*self.case)
        quantiles = self.posterior.quantile(np.array([0.005, 0.05, 0.5, 0.95, 0.995])).T
        return [
            Row(
                name,
                self.posterior.model.unit(name),
                published[name],
                float(self.fit.theta[i]),
                float(self.fit.sd[i]),
                tuple(float(q) for q in quantiles[i]),
            )
            for i, name in enumerate(self.posterior.names)
        ]


@dataclass(frozen=True)
class Row:
    """A parameter: as published, by least squares, and the posterior's quantiles.

    `quantiles` are at 0.5, 5, 50, 95 and 99.5 %.
    """

    name: str
    unit: str
    published: float
    fitted: float
    sd: float
    quantiles: tuple[float, ...]

    @property
    def covered(self) -> bool:
        """Whether the 99 % interval holds the published value."""
        return self.quantiles[0] <= self.published <= self.quantiles[-1]


def logged(run: SimulatedRecording) -> Recording:
    """What the logger wrote, without the truth."""
    return recording_from_arrays(**run.signals)


def identify(case: tuple[str, str], ess: int = 1000) -> Identified:
    """Simulate the paper's experiment on the bench, and identify the model from it."""
    device, name = case
    bench = Bench.from_device(device, held=name == "grasped")
    etfe = estimate_etfe(logged(simulate(bench, seed=SEED)), band_hz=bench.band_hz)
    return _identified(case, etfe, ess)


def identify_rigid(ess: int = 1000) -> Identified:
    """The rigid PHANToM: two parameters from the free device below its first mode."""
    bench = replace(Bench.from_device("phantom"), band_hz=(0.7, 200.0))
    etfe = estimate_etfe(logged(simulate(bench, seed=SEED)), band_hz=RIGID_BAND_HZ)
    return _identified(("phantom", "rigid"), etfe, ess)


def _identified(case: tuple[str, str], etfe: Etfe, ess: int) -> Identified:
    device, name = case
    model = build_model(name, device)
    fit = least_squares(model, etfe, seed=SEED)
    posterior = sample(model, etfe, start=fit, ess=ess, seed=SEED)
    return Identified(case, etfe, fit, posterior, critical_stiffness(posterior))


def identify_all(ess: int = 1000) -> list[Identified]:
    """The four cases of Table III, and the rigid PHANToM."""
    return [*(identify(case, ess) for case in CASES), identify_rigid(ess)]


def tip_rows(held: Identified) -> list[Row]:
    """The PHANToM's hand at the tip: divided by the lever arm squared."""
    units = {"mh": "kg", "bh": "N s/m", "kh": "N/m"}
    scale = 1 / LEVER_M**2
    return [
        Row(
            row.name,
            units[row.name],
            TABLES["human_at_tip"][AT_TIP[row.name]],
            row.fitted * scale,
            row.sd * scale,
            tuple(q * scale for q in row.quantiles),
        )
        for row in held.rows
        if row.name in AT_TIP
    ]
