"""The response of a loop with dynamic links (delayed forces, hysteresis): no finite set of poles.

It is that of the rational part, from its poles, and what the links add: see
`models/response/remainder.py`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bayeshaptic.models.response.aliases import Aliases, alias_sums, aliases, smooth_aliases
from bayeshaptic.models.response.remainder import Remainder
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.stability.responses.evaluated import ends, held_at_rest
from bayeshaptic.stability.responses.grid import in_chunks, search_grid
from bayeshaptic.stability.responses.response import PoleResponse, pole_response
from bayeshaptic.types import Bools, Complexes, Floats, Ints

_BEYOND = np.geomspace(np.pi, 100 * np.pi, 60)  # angles above the grid's last one


@dataclass(frozen=True)
class LinkedResponse:
    """The response of a rational part and a remainder.

    Attributes
    ----------
    rational : PoleResponse
    remainder : Remainder
    aliases : Aliases
    rough : ndarray of bool, shape (B,)
        Where the aliases are to be summed term by term.
    delay : ndarray, shape (B,)
        Of the remainder, in periods.
    period_s : float
    log_points : int
    """

    rational: PoleResponse
    remainder: Remainder
    aliases: Aliases
    rough: Bools
    delay: Floats
    period_s: float
    log_points: int = 250

    @property
    def features(self) -> Complexes:
        return self.rational.features

    def at(self, rows: Ints, theta: Floats) -> Complexes:
        return self.rational.at(rows, theta) + self._added(rows, theta.T).T

    def _added(self, rows: Ints, theta: Floats) -> Complexes:
        """What the links add at angles of shape (k, M)."""
        part = self.remainder.rows(rows)
        value = part.on_axis(theta / self.period_s)
        if not self.rational.exact:
            late = np.exp(-1j * theta * self.delay[rows])
            return np.asarray(value * (1j * theta / self.period_s) * late)
        rough = self.rough[rows]
        if rough.any():
            delay_s = self.delay[rows[rough]] * self.period_s
            sums = alias_sums(part.rows(rough), theta[:, rough], delay_s, self.period_s)
            value[:, rough] += sums - self.aliases.at(theta[:, rough], rows[rough])
        return self.aliases.sampled(value, theta, rows, self.delay[rows], self.period_s)

    def at_ends(self) -> tuple[Floats, Floats]:
        return ends(self, self.rational.exact)

    def stable_at_rest(self) -> Bools:
        """As for the rational part, and no pole to the right of the imaginary axis by the links.

        Their number is how often the return difference 1 + lambda h_ee goes round the origin.
        """
        quiet = [self._goes_not_round(rows) for rows in in_chunks(len(self.delay))]
        return self.rational.stable_at_rest() & np.concatenate(quiet) & held_at_rest(self)

    def _goes_not_round(self, rows: slice) -> Bools:
        """Where the return difference does not go round the origin, of some rows."""
        theta = search_grid(self, rows)
        beyond = np.broadcast_to(_BEYOND, (len(theta), len(_BEYOND)))
        omega = np.concatenate([theta, beyond], axis=1).T / self.period_s
        phase = np.unwrap(np.angle(self.remainder.rows(rows).return_difference(omega)), axis=0)
        return np.asarray(np.abs(phase[-1] - phase[0]) < np.pi)


def linked_response(system: LinearSystem, period_s: float, exact: bool) -> LinkedResponse:
    """The response of a batch of loops with dynamic links.

    Parameters
    ----------
    system : LinearSystem
        With dynamic links.
    period_s : float
        Sampling period, s.
    exact : bool
        False: the continuous approximation P(s) e^{-s (td + T/2)}.
    """
    rational = pole_response(system.rational_part, period_s, exact)
    remainder = system.remainder
    series = aliases(remainder, np.pi, system.delay_s, period_s)
    fastest = np.abs(np.linalg.eigvals(system.mechanism.state_matrix())).max(axis=1) * period_s
    rough = ~smooth_aliases(fastest, np.pi)
    delay = system.delay_s / period_s + (0.0 if exact else 0.5)
    return LinkedResponse(rational, remainder, series, rough, delay, period_s)
