"""The critical stiffness of a model, or its distribution over a posterior."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from bayeshaptic.arguments import at_the_door
from bayeshaptic.errors import InputError, Notice
from bayeshaptic.models.model import Model
from bayeshaptic.numerics.effective_draws import effective_draws
from bayeshaptic.quantities import estimate, percent, quantity, rounded_down
from bayeshaptic.shown import Shown, data_frame
from bayeshaptic.stability.binding import BindingCrossing, group_crossings
from bayeshaptic.stability.crossings import rational
from bayeshaptic.stability.draws import opened, vectors_of
from bayeshaptic.stability.each_draw import limits_of
from bayeshaptic.stability.limit_draws import LimitDraws
from bayeshaptic.stability.spectral_radius import confirms
from bayeshaptic.stability.tail import LowQuantile, low_quantile
from bayeshaptic.threads import single_threaded
from bayeshaptic.types import Floats, Ints


@dataclass(frozen=True, eq=False, repr=False)
class CriticalStiffness(LimitDraws, Shown):
    """K_CR of each draw of a posterior, or of one model.

    Attributes
    ----------
    samples : ndarray, shape (n,)
        K_CR in `unit`; chains one after the other.  0 where the loop is unstable at any stiffness,
        inf where nothing limits it.
    frequency_hz : ndarray, shape (n,)
        Of the binding crossing; 0 and nan where K_CR is 0 and inf.
    unit : str
        "N/m", "N m/rad", "A/m" or "A/rad".
    crossings : tuple of BindingCrossing
        Which crossing binds with what probability, the most probable first.
    group : ndarray of int, shape (n,)
        Index into `crossings`.
    chains : int
        Number of chains (walkers of all ensembles) that `samples` consists of.
    checked, confirmed : int
        Draws whose limit was checked by the spectral radius just below and above, and how many
        of them hold.
    notices : tuple of Notice
    explanations : tuple of str
        What else explains the recording, where draws of that are among these.
    explained_by : ndarray of int, shape (n,), or None
        0 where a draw is of the model itself, else one more than the index of its explanation.
    """

    samples: Floats = field(repr=False)
    frequency_hz: Floats = field(repr=False)
    unit: str
    crossings: tuple[BindingCrossing, ...]
    group: Ints = field(repr=False)
    chains: int = 1
    checked: int = 0
    confirmed: int = 0
    notices: tuple[Notice, ...] = ()
    explanations: tuple[str, ...] = ()
    explained_by: Ints | None = field(default=None, repr=False)

    @property
    def value(self) -> float:
        """K_CR of the one model; the median of a distribution."""
        return float(self.quantile(0.5))

    @cached_property
    def effective(self) -> float:
        """Effective number of draws of K_CR (of its ranks), each walker a chain."""
        ranks = np.unique(self.samples, return_inverse=True)[1]
        return effective_draws(ranks.reshape(self.chains, -1))

    @at_the_door
    def safe(self, risk: float) -> float | None:
        """The stiffness that is unstable with probability `risk`.

        The quantile of the draws where 20 effective ones lie below it; else that of a generalised
        Pareto distribution fitted to the lowest of them.  None where these are too few for either
        (or where there is one model only): the number would be an accident of the draws.
        """
        found = self.low_quantile(risk)
        return None if found is None else found.value

    @at_the_door
    def low_quantile(self, risk: float) -> LowQuantile | None:
        """What `safe` says, with its Monte-Carlo error.

        Parameters
        ----------
        risk : float
        """
        if risk not in self._low_quantiles:
            self._low_quantiles[risk] = low_quantile(self._ordered, risk, self.effective_at)
        return self._low_quantiles[risk]

    @at_the_door
    def effective_at(self, stiffness: float) -> float:
        """Effective number of draws that the share below a stiffness is counted from.

        Parameters
        ----------
        stiffness : float
        """
        return effective_draws((self.samples < stiffness).reshape(self.chains, -1))

    @at_the_door
    def effective_below(self, risk: float) -> float:
        """How many effective draws lie below the stiffness at which the loop fails with `risk`."""
        return self.effective_at(self.quantile(risk)) * risk

    @at_the_door
    def tip(self, lever_m: float) -> CriticalStiffness:
        """The same at the tip of a rotational device's lever arm `lever_m`: K / lever^2, in N/m.

        Raises
        ------
        InputError
            If the device is not rotational, its force is not in N m, or the lever is not positive.
        """
        if self.unit != "N m/rad":
            raise InputError(
                f"a stiffness in {self.unit} has no tip; only one in N m/rad does: give the force "
                "as a torque in N m and the position as an angle."
            )
        if not lever_m > 0:
            raise InputError(f"lever_m is {lever_m}; give the lever arm in metres, above zero.")
        return replace(self, samples=self.samples / lever_m**2, unit="N/m")

    def to_dataframe(self) -> Any:
        """A ``pandas.DataFrame``, a row a draw: limit, frequency, label of what binds."""
        return data_frame(
            {
                "critical_stiffness": float(self.samples[i]),
                "unit": self.unit,
                "frequency_hz": float(self.frequency_hz[i]),
                "binds": self.crossings[int(self.group[i])].label,
            }
            for i in range(len(self.samples))
        )

    @cached_property
    def _low_quantiles(self) -> dict[float, LowQuantile | None]:
        return {}

    def _lines(self) -> tuple[str, ...]:
        low, middle, high = (float(self.quantile(p)) for p in (0.05, 0.5, 0.95))
        binds = ", ".join(f"{c.label} ({percent(c.probability)})" for c in self.crossings[:3])
        if len(self.samples) == 1:
            return (
                f"Critical stiffness {quantity(middle, self.unit, digits=4)}",
                f"binds: {binds}",
            )
        safe = [
            f"{rounded_down(found, self.unit, low, high).text} at {percent(risk)}"
            for risk in (0.05, 0.01, 0.001)
            if (found := self.safe(risk)) is not None
        ]
        return (
            f"Critical stiffness {estimate(middle, low, high, self.unit)}, median and 90 % "
            f"interval of {len(self.samples):,} draws",
            f"by risk of instability: {', '.join(safe) or 'too few draws to say'}",
            f"binds: {binds}",
        )


@at_the_door
@single_threaded
def critical_stiffness(
    source: Any,
    theta: ArrayLike | None = None,
    approximation: str = "exact",
    max_draws: int | None = None,
    before: CriticalStiffness | None = None,
) -> CriticalStiffness:
    """Critical stiffness of a model at its own values, of a fit, or of every draw of a posterior.

    Parameters
    ----------
    source : Model, Fit, Posterior, Case, Analysis or Closed
        Of the last two the draws of their posterior; their `limit` allows for more than these.
    theta : array_like, shape (n, P) or (P,), optional
        With a model: the parameter vectors to use instead of its device file's.
    approximation : {"exact", "continuous"}
        "continuous" is the paper's P(s) e^{-s (td + T/2)}; it is not the truth of a sampled loop.
    max_draws : int, optional
        A longer posterior is thinned, every so many steps of each chain; by default one of more
        than 150,000 draws, 30,000 where the loop has no finite set of poles.
    before : CriticalStiffness, optional
        Of all draws of this posterior while its chains were shorter: what has been found is not
        searched again.

    Returns
    -------
    CriticalStiffness

    Raises
    ------
    InputError
        If the source is none of these, the model has no values or no sampling period, a mass is
        not above 0, or the approximation is unknown.

    Notes
    -----
    K_CR is the smallest -1/Re G over all frequencies where the sampled response G is real and
    negative, the Nyquist frequency included (I. Diaz and J. J. Gil, IEEE Transactions on Robotics
    26(1), 2010, with an exact hold).
    """
    if approximation not in ("exact", "continuous"):
        raise InputError(f'approximation is "exact" or "continuous", not {approximation!r}.')
    model, holder, _ = opened(source)
    vectors, chains = vectors_of(source, theta, max_draws)
    if model.period_s is None:
        raise InputError("the model has no sampling period: give period_s, or a device.")
    if (
        before is not None
        and hasattr(holder, "chains")
        and len(vectors) < np.asarray(holder.chains)[..., 0].size
    ):
        before = None  # thinned: other draws than those
    limit = _limits(model, vectors, chains, approximation, before)
    checkable = approximation == "exact" and rational(model.system(vectors[:1]))
    return _checked(limit, model, vectors) if checkable else limit


def _limits(
    model: Model,
    vectors: Floats,
    chains: int,
    approximation: str,
    before: CriticalStiffness | None,
) -> CriticalStiffness:
    """The limit of each vector, shape (n, P), with what binds; `before` has those known already."""
    by_chain = vectors.reshape(chains, -1, vectors.shape[1])
    known = None
    if before is not None and before.chains == chains:
        known = np.stack([before.samples, before.frequency_hz]).reshape(2, chains, -1)
    samples, frequency, kinds = limits_of(model, by_chain, approximation, known)
    crossings, group = group_crossings(kinds, frequency)
    return CriticalStiffness(samples, frequency, model.stiffness_unit, crossings, group, chains)


def _checked(limit: CriticalStiffness, model: Model, vectors: Floats) -> CriticalStiffness:
    """With draws at equal steps of probability checked against the closed loop's own poles."""
    checked, longest = 64, 200  # draws, and samples of delay: each is a pole
    assert model.period_s is not None
    order = np.argsort(limit.samples)
    order = order[model.system(vectors[order]).delay_s < longest * model.period_s]
    if not len(order):
        return limit
    count = min(checked, len(order))
    pick = order[np.linspace(0, len(order) - 1, count).astype(int)]
    held = int(confirms(model.system(vectors[pick]), model.period_s, limit.samples[pick]).sum())
    notices = limit.notices
    if held < count:
        text = (
            f"for {count - held} of {count} checked draws the closed loop's poles do not confirm "
            "the critical stiffness; do not rely on it."
        )
        notices = (*notices, Notice("warning", "critical stiffness", text))
    return replace(limit, checked=count, confirmed=held, notices=notices)
