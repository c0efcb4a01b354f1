"""The posterior: draws of the parameters, with what it takes to trust them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from bayeshaptic.arguments import at_the_door
from bayeshaptic.inference.diagnostics import Diagnostics
from bayeshaptic.inference.saved.arviz_groups import save_posterior, to_arviz
from bayeshaptic.models import Model
from bayeshaptic.quantities import scale
from bayeshaptic.recordings.response.etfe import Etfe
from bayeshaptic.recordings.response.windows import Windows
from bayeshaptic.shown import Shown, data_frame, listed
from bayeshaptic.types import Floats


@dataclass(frozen=True, eq=False, repr=False)
class Posterior(Shown):
    """Draws from the posterior of a model's parameters.

    Attributes
    ----------
    model : Model
    chains : ndarray, shape (ensembles, steps, walkers, P)
        Natural values.
    log_likelihood : ndarray, shape (ensembles, steps, walkers)
        Up to a constant.
    diagnostics : Diagnostics
    converged : bool
    message : str
        Why it is, or is not, converged; in words and numbers.
    seconds : float
        Fit of the proposal and adaptation included.
    seed : int
    windows : Windows or None
        What the likelihood was computed from.
    etfe : Etfe or None
        What was measured.
    """

    model: Model
    chains: Floats = field(repr=False)
    log_likelihood: Floats = field(repr=False)
    diagnostics: Diagnostics
    converged: bool
    message: str
    seconds: float
    seed: int
    windows: Windows | None = field(default=None, repr=False)
    etfe: Etfe | None = field(default=None, repr=False)

    @property
    def names(self) -> tuple[str, ...]:
        return self.model.names

    @cached_property
    def draws(self) -> Floats:
        """All draws, shape (n, P)."""
        return self.chains.reshape(-1, self.chains.shape[-1])

    @property
    def effective(self) -> float:
        """Smallest effective sample size, bulk or tail, of any parameter."""
        return self.diagnostics.ess

    @property
    def rhat(self) -> Floats:
        return self.diagnostics.rhat

    @property
    def ess_bulk(self) -> Floats:
        return self.diagnostics.ess_bulk

    @property
    def ess_tail(self) -> Floats:
        return self.diagnostics.ess_tail

    @at_the_door
    def quantile(self, p: float | Floats) -> Floats:
        """Quantiles of every parameter at the probabilities `p`, shape (..., P)."""
        return np.quantile(self.draws, p, axis=0)

    @cached_property
    def prior_dominated(self) -> Mapping[str, bool]:
        """Name to whether the posterior is hardly narrower than the prior.

        Compared in the coordinate of sampling, by the central 68 % ranges.
        """
        return dict(zip(self.names, prior_dominated(self.model, self.draws), strict=True))

    def summary(self) -> dict[str, dict[str, Any]]:
        """Mean, sd, quantiles, unit and diagnostics of every parameter, by name."""
        return {name: dict(row) for name, row in self._summary.items()}

    @cached_property
    def _summary(self) -> dict[str, dict[str, Any]]:
        q05, q50, q95 = self.quantile(np.array([0.05, 0.5, 0.95]))
        return {
            name: {
                "mean": float(self.draws[:, i].mean()),
                "sd": float(self.draws[:, i].std(ddof=1)),
                "q05": float(q05[i]),
                "q50": float(q50[i]),
                "q95": float(q95[i]),
                "unit": self.model.unit(name),
                "ess_bulk": float(self.ess_bulk[i]),
                "ess_tail": float(self.ess_tail[i]),
                "rhat": float(self.rhat[i]),
                "prior_dominated": self.prior_dominated[name],
            }
            for i, name in enumerate(self.names)
        }

    def to_arviz(self) -> Any:
        """An ArviZ InferenceData (0.x) or DataTree (1.x), each ensemble a chain."""
        return to_arviz(self)

    @at_the_door
    def save(self, path: str | Path) -> Path:
        """Write it to `path` as netCDF for `load_posterior`; never leaves half a file."""
        return save_posterior(self, Path(path))

    def to_dataframe(self) -> Any:
        """`summary` as a ``pandas.DataFrame``, a row a parameter."""
        rows = ({"parameter": name, **found} for name, found in self.summary().items())
        return data_frame(rows, "parameter")

    def _lines(self) -> tuple[str, ...]:
        found = []
        for name, one in self.summary().items():
            row = scale(one["mean"], one["unit"])
            found.append(f"{name} {row.with_error(one['mean'], one['sd'])} {row.unit}".rstrip())
        state = "converged" if self.converged else "not converged"
        return (
            f"Posterior of the model {self.model.name}: {len(self.draws):,} draws, {state}",
            f"largest R-hat {float(np.max(self.rhat)):.3f}, {self.effective:.0f} effective draws",
            listed(found, 4),
        )


def prior_dominated(model: Model, draws: Floats) -> list[bool]:
    """Whether `draws`, shape (n, P), of each parameter are hardly narrower than its prior."""
    out = []
    dominated = 0.5  # posterior sd over prior sd from which the prior decides
    for name, column in zip(model.names, draws.T, strict=True):
        prior = model.prior(name)
        own = np.quantile(column, [0.16, 0.84])
        believed = prior.quantile([0.16, 0.84])
        if prior.coordinate == "log":
            own, believed = np.log(np.maximum(own, np.finfo(float).tiny)), np.log(believed)
        out.append(bool(np.ptp(own) > dominated * np.ptp(believed)))
    return out
