"""Which parameters the uncertainty of the critical stiffness comes from."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from bayeshaptic.arguments import at_the_door
from bayeshaptic.shown import Shown, data_frame, listed
from bayeshaptic.stability.crossings import find_crossings
from bayeshaptic.stability.walls.loops import loops_of
from bayeshaptic.types import Floats

DRAWS = 3000
TIED = 0.7  # rank correlation from which parameters are told apart no more
_WIDENED = 0.95  # a stated variance that is less wide than this makes it is the parameters' own


@dataclass(frozen=True)
class Share:
    """One parameter, or several that the data tie to each other.

    Attributes
    ----------
    names : tuple of str
    share : float
        Of the variance of ln K_CR, that goes when these were known: 0 to 1.
    correlation : float
        Largest rank correlation inside of the group, with its sign; 0 for a single parameter.
    """

    names: tuple[str, ...]
    share: float
    correlation: float = 0.0


@dataclass(frozen=True, repr=False)
class VarianceShares(Shown):
    """First-order shares of the variance of ln K_CR.

    Attributes
    ----------
    shares : tuple of Share
        The largest first.
    log_sd : float
        Standard deviation of ln K_CR as it is stated, whatever widens it included.
    beyond : float
        Share that is not of the parameters: effects of uncertain strength, what is unexplained.
    draws : int
    """

    shares: tuple[Share, ...]
    log_sd: float
    beyond: float
    draws: int

    def _lines(self) -> tuple[str, ...]:
        told = (f"{' and '.join(one.names)} {100 * one.share:.0f} %" for one in self.shares)
        return (
            f"Shares of the variance of ln K, {self.draws:,} draws",
            listed(told) or "none",
            f"the limit is known to ± {20 / np.log(10) * self.log_sd:.2g} dB (sd)",
        )

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a group of parameters: share and correlation."""
        rows = ({**vars(one), "names": ", ".join(one.names)} for one in self.shares)
        return data_frame(rows, "names")

    @property
    def together(self) -> float:
        """Sum of all shares with `beyond`; the rest to 1 is interaction, above 1 correlation."""
        return sum(share.share for share in self.shares) + self.beyond


@at_the_door
def variance_shares(source: Any, draws: int = DRAWS) -> VarianceShares:
    """Shares of the variance of ln K_CR over a posterior.

    Parameters
    ----------
    source : Posterior, Case, Analysis or Closed
    draws : int
        About how many are used.

    Returns
    -------
    VarianceShares

    Notes
    -----
    The share of a parameter is var(E[ln K_CR | parameter]) / var(ln K_CR), estimated from the
    draws at hand by regression on orthogonal polynomials of its rank, less what chance would
    explain (R^2 adjusted for the effective number of draws).  Parameters with a rank correlation
    beyond 0.7 are taken together: the variance of a combination that the data fix has no owner
    among them.

    References
    ----------
    E. Plischke, E. Borgonovo and C. L. Smith, "Global sensitivity measures from given data",
    European Journal of Operational Research 226(3), 2013.
    """
    loops = loops_of(source, draws=draws)
    critical = find_crossings(loops.model.system(loops.draws), loops.period_s).critical
    usable = np.isfinite(critical) & (critical > 0)
    values, log_k = loops.draws[usable], np.log(critical[usable])
    own = float(np.var(log_k))
    stated = own
    if loops.target is not None:
        target = loops.target[np.isfinite(loops.target) & (loops.target > 0)]
        widened = float(np.var(np.log(target))) if len(target) else own
        stated = widened if own < _WIDENED * widened else own
    if len(log_k) < 2 or own == 0:
        return VarianceShares((), float(np.sqrt(stated)), 0.0, len(log_k))
    effective = min(loops.effective, float(len(log_k)))
    scores = _normal_scores(values)
    found = [
        _share(loops.model.names, group, scores, log_k, effective, own / stated)
        for group in tied_groups(scores)
    ]
    found.sort(key=lambda share: -share.share)
    return VarianceShares(tuple(found), float(np.sqrt(stated)), 1 - own / stated, len(log_k))


def tied_groups(scores: Floats) -> list[list[int]]:
    """Which parameters are to be taken together, because the data know only their sum or ratio.

    Parameters
    ----------
    scores : ndarray, shape (n, P)
        Normal scores of the parameters over n draws.

    Returns
    -------
    list of list of int
        Columns; those whose correlation is beyond `TIED` are in one group, directly or by a third.
    """
    size = scores.shape[1]
    tied = np.abs(_correlation(scores)) > TIED
    label = np.arange(size)
    for i, j in zip(*np.nonzero(tied), strict=True):
        label[label == label[j]] = label[i]
    return [list(np.flatnonzero(label == one)) for one in dict.fromkeys(label.tolist())]


def explained(columns: Floats, values: Floats, effective: float) -> float:
    """Share of a variance that some parameters explain, less what chance explains.

    Parameters
    ----------
    columns : ndarray, shape (n, g)
        Normal scores of g parameters over n draws.  Of one parameter the function is a polynomial
        of its rank, of several one of their principal scores.
    values : ndarray, shape (n,)
        What varies.
    effective : float
        Effective number of the draws.

    Returns
    -------
    float
        From 0 to 1.
    """
    from scipy.special import ndtr

    if columns.shape[1] == 1:
        rank = 2 * ndtr(columns[:, 0]) - 1
        degree = 6  # of the polynomial in one parameter's rank
        basis = legendre.legvander(rank, degree)
    else:
        basis = _joint_basis(columns)
    left = values - basis @ np.linalg.lstsq(basis, values, rcond=None)[0]
    terms = basis.shape[1] - 1
    freedom = (effective - 1) / max(effective - 1 - terms, 1.0)
    return float(np.clip(1 - freedom * left.var() / values.var(), 0.0, 1.0))


def _share(
    names: tuple[str, ...],
    group: list[int],
    scores: Floats,
    log_k: Floats,
    effective: float,
    scale: float,
) -> Share:
    """The share of one group of tied parameters; `scale` puts it to the variance that is stated."""
    share = scale * explained(scores[:, group], log_k, effective)
    inside = np.tril(_correlation(scores[:, group]), -1) if len(group) > 1 else np.zeros((1, 1))
    strongest = float(inside.flat[np.argmax(np.abs(inside))])
    return Share(tuple(names[i] for i in group), share, strongest)


def _joint_basis(columns: Floats) -> Floats:
    """Products of powers of the group's principal scores."""
    centred = columns - columns.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred, full_matrices=False)
    scores = centred @ axes.T / np.maximum(sizes, 1e-12) * np.sqrt(len(columns))
    count = columns.shape[1]
    joint_degree = 3  # of the polynomial in a group's scores; 2 in large groups
    large = 4
    degree = joint_degree if count <= large else 2
    terms = [np.ones(len(columns))]
    for power in range(1, degree + 1):
        for chosen in combinations_with_replacement(range(count), power):
            terms.append(np.prod(scores[:, chosen], axis=1))
    return np.stack(terms, axis=1)


def _normal_scores(values: Floats) -> Floats:
    """Ranks of each column as normal quantiles; a constant column is zero."""
    from scipy.special import ndtri

    rank = np.argsort(np.argsort(values, axis=0), axis=0)
    scores = ndtri((rank + 0.5) / len(values))
    return np.where(np.ptp(values, axis=0) > 0, scores, 0.0)


def _correlation(scores: Floats) -> Floats:
    """Correlations between columns, shape (P, P); 0 beside a constant one."""
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.corrcoef(scores, rowvar=False)
    return np.nan_to_num(np.atleast_2d(found))
