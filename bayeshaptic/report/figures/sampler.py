"""Whether the sampler has done its work: trace, ranks, and effective draws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.diagnosis.result import Result
from bayeshaptic.report.figures import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


RANK_BINS = 20
STEPS_SHOWN = 400


def draw(result: Result) -> Figure:
    """Trace and ranks of the parameter that mixes worst, effective draws and R-hat of all."""
    analysis = result.analysis
    posterior = analysis.posterior
    worst = int(np.argmax(posterior.rhat))
    name = style.short(posterior.model.names[worst])
    chains = posterior.chains[..., worst]
    figure = style.new_figure(4.3)
    trace, ranks, draws, rhat = figure.subplots(2, 2).ravel()
    _trace(trace, chains, name)
    _ranks(ranks, chains, name)
    _draws(draws, posterior)
    _rhat(rhat, posterior)
    return figure


def rank_histogram(chains: NDArray[Any]) -> NDArray[Any]:
    """Shares of each ensemble's draws in `RANK_BINS` ranks of all draws, over the share expected.

    Parameters
    ----------
    chains : ndarray, shape (E, S, W)

    Returns
    -------
    ndarray, shape (E, RANK_BINS)
        1 everywhere when all ensembles sample the same density (Vehtari et al., 2021).
    """
    flat = chains.reshape(len(chains), -1)
    rank = np.argsort(np.argsort(flat, axis=None)).reshape(flat.shape)
    share = [np.histogram(row, RANK_BINS, (0, flat.size))[0] for row in rank]
    return np.array(share) * RANK_BINS / flat.shape[1]


def _trace(axes: Axes, chains: NDArray[Any], name: str) -> None:
    """Mean over the walkers of each ensemble, in sd of the posterior: comparable and unit-free."""
    style.panel(axes, "step", "mean of walkers / sd", title=f"trace of {name}")
    mean = (chains.mean(axis=2) - chains.mean()) / (chains.std() or 1.0)
    every = max(mean.shape[1] // STEPS_SHOWN, 1)
    steps = np.arange(mean.shape[1])[::every]
    for index, row in enumerate(mean):
        axes.plot(steps, row[::every], linewidth=0.7, **_look(index), label=f"ensemble {index + 1}")
    limit = max(float(np.abs(mean).max()), 0.3)
    axes.set_ylim(-1.2 * limit, 1.8 * limit)
    style.legend(axes, loc="upper left", ncols=2, fontsize=style.SMALL)


def _ranks(axes: Axes, chains: NDArray[Any], name: str) -> None:
    style.panel(axes, "rank among all draws", "share / expected", title=f"ranks of {name}")
    histogram = rank_histogram(chains)
    edges = np.linspace(0.0, 1.0, histogram.shape[1] + 1)
    for index, row in enumerate(histogram):
        axes.stairs(row, edges, linewidth=0.9, baseline=None, **_look(index))
    axes.axhline(1.0, color=style.DATA, linewidth=0.6)
    axes.set_xlim(0, 1)
    spread = max(float(np.abs(histogram - 1).max()), 0.25)
    axes.set_ylim(max(1 - 1.2 * spread, 0.0), 1 + 1.2 * spread)


def _draws(axes: Axes, posterior: Any) -> None:
    style.panel(axes, y="effective draws", title="effective draws of each parameter")
    place = np.arange(len(posterior.ess_bulk))
    axes.bar(place - 0.2, posterior.ess_bulk, 0.4, color=style.MODEL, label="bulk")
    axes.bar(
        place + 0.2,
        posterior.ess_tail,
        0.4,
        facecolor="white",
        edgecolor=style.MODEL,
        hatch="/////",
        linewidth=0.6,
        label="tail",
    )
    _names(axes, posterior)
    axes.set_ylim(0, 1.3 * float(max(posterior.ess_bulk.max(), posterior.ess_tail.max())))
    style.legend(axes, loc="upper left", ncols=2)


def _rhat(axes: Axes, posterior: Any) -> None:
    style.panel(axes, y="R-hat − 1", title="R-hat between ensembles")
    place = np.arange(len(posterior.rhat))
    axes.plot(place, np.maximum(posterior.rhat - 1, 1e-5), "o", color=style.MODEL, markersize=4)
    axes.axhline(0.01, color=style.OTHER, linestyle="--", linewidth=0.9, label="0.01")
    style.log_scale(axes.yaxis)
    axes.set_ylim(5e-6, max(0.1, 3 * float(posterior.rhat.max() - 1)))
    style.legend(axes, loc="upper right")
    _names(axes, posterior)


def _names(axes: Axes, posterior: Any) -> None:
    names = [style.short(name) for name in posterior.model.names]
    many = len(names) > 6
    axes.set_xticks(range(len(names)), names, rotation=90 if many else 0)
    axes.set_xlim(-0.6, max(len(names), 3) - 0.4)


def _look(index: int) -> dict[str, Any]:
    return {
        "color": style.CYCLE[index % len(style.CYCLE)],
        "linestyle": style.DASHES[index % len(style.DASHES)],
    }
