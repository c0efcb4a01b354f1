"""Responses as the crossing search reads them: any batch row at any of its own frequencies.

Frequencies are angles theta = w T in (0, pi].  With the delay split as td = d T + e, poles p_i and
residues r_i, and phi(x) = expm1(x) / x, the exact sampled response is

    G = z^-d  sum_i  [ r_i (T - e) phi(p_i (T-e)) + z^-1 r_i exp(p_i (T-e)) e phi(p_i e) ]
                     / [ (z - 1) - expm1(p_i T) ]

The differences from 1 are formed without cancellation, so crossings at micro-hertz are as accurate
as those at the Nyquist frequency.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bayeshaptic.models.response.filters import filtered
from bayeshaptic.models.response.system import LinearSystem
from bayeshaptic.models.response.transfer import transfer, transfer_with_link
from bayeshaptic.numerics.polynomials.partial_fractions import moved_apart, residues
from bayeshaptic.numerics.polynomials.polynomial import Polynomial
from bayeshaptic.types import Complexes, Floats, Ints


class Response(Protocol):
    """What the search for crossings needs to know of a batch of loops.

    Attributes
    ----------
    delay : ndarray, shape (B,)
        Whole loop delay in periods: how fast the phase turns at high frequency.
    features : ndarray of complex, shape (B, n)
        Poles times T, where the response may turn quickly; n may be 0.
    log_points : int
        Points of the logarithmic grid that leave no turn out, beside those around its features.
    """

    @property
    def delay(self) -> Floats: ...

    @property
    def features(self) -> Complexes: ...

    @property
    def log_points(self) -> int: ...

    def at(self, rows: Ints, theta: Floats) -> Complexes:
        """Values of some loops, each at its own angles.

        Parameters
        ----------
        rows : ndarray of int, shape (M,)
            Which loops of the batch; one may come more than once.
        theta : ndarray, shape (M, k)
            Angles in (0, pi].

        Returns
        -------
        ndarray of complex, shape (M, k)
            Position over force.
        """

    def at_ends(self) -> tuple[Floats, Floats]:
        """Real limits of each loop at both ends, shape (B,) each.

        At theta -> 0, infinite for an integrator; and at theta = pi, nan where there is none.
        """

    def stable_at_rest(self) -> NDArray[np.bool_]:
        """Whether the loop is stable for K -> 0+, shape (B,)."""


@dataclass(frozen=True)
class PoleResponse:
    """The response of a loop that has finitely many poles.

    Attributes
    ----------
    poles, residues : ndarray of complex, shape (B, n)
        Of the continuous transfer function, times T each.
    direct, late : ndarray of complex, shape (B, n)
        Numerators of each pole's term: without and with a further z^-1.
    centre : ndarray of complex, shape (B, n)
        What is subtracted in the denominator.
    delay : ndarray, shape (B,)
        Delay factor e^{-j theta delay}.
    integrators : ndarray of int, shape (B,)
        How many poles are exactly at zero.
    exact : bool
        False: the continuous approximation P(s) e^{-s (td + T/2)}.
    """

    poles: Complexes
    residues: Complexes
    direct: Complexes
    late: Complexes
    centre: Complexes
    delay: Floats
    integrators: NDArray[np.int_]
    exact: bool
    log_points: int = 60

    @property
    def features(self) -> Complexes:
        return self.poles

    def at(self, rows: Ints, theta: Floats) -> Complexes:
        from bayeshaptic.stability.responses.response_kernel import values

        out = np.empty(theta.shape, complex)
        tables = self.direct, self.late, self.centre, self.delay
        loops, angles = np.ascontiguousarray(rows), np.ascontiguousarray(theta)
        values(*tables, self.exact, loops, angles, out)
        return out

    def at_ends(self) -> tuple[Floats, Floats]:
        with np.errstate(divide="ignore", invalid="ignore"):
            static = -(self.residues / self.poles).sum(axis=1).real
        static = np.where(self.integrators == 0, static, np.inf)
        if not self.exact:  # real at no particular frequency
            return static, np.full(len(static), np.nan)
        nyquist = ((self.direct - self.late) / (-2.0 - self.centre)).sum(axis=1).real
        return static, nyquist * np.cos(np.pi * self.delay)

    def stable_at_rest(self) -> NDArray[np.bool_]:
        """Poles inside the unit circle, or on it and leaving it inwards as K grows.

        Near a pole z0 on the circle with residue R the closed-loop pole is z0 - K R, so it goes
        inwards where Re(conj(z0) R) > 0.
        """
        size = np.abs(self.poles)
        # Rounding is that of the pole itself, or of those of the mechanism beside it, none of which
        # matters beyond a radian a sample: a filter of a microsecond, whose pole is at a thousand,
        # made slow poles marginal that had 1e-7 of damping, and the limit 0.
        scale = np.maximum(size, np.minimum(size.max(axis=1, keepdims=True), 1.0))
        marginal = np.abs(self.poles.real) <= 1e-10 * scale
        z0 = np.exp(1j * np.where(marginal, self.poles.imag, 0.0))
        residue = (self.direct + self.late / z0) * z0 ** -self.delay[:, None]
        outwards = (np.conj(z0) * residue).real < 0
        unstable = np.where(marginal, outwards, self.poles.real > 0).any(axis=1)
        return ~unstable & (self.integrators < 2)


def pole_response(system: LinearSystem, period_s: float, exact: bool = True) -> PoleResponse:
    """The response of a batch of loops from their poles.

    A link that is a ratio of polynomials has poles, too; where they do not settle they are nan.

    Parameters
    ----------
    system : LinearSystem
    period_s : float
        Sampling period, s.
    exact : bool
        False: the continuous approximation P(s) e^{-s (td + T/2)}.
    """
    poles, parts, integrators = _simple_poles(system, period_s)
    p, r = poles * period_s, parts * period_s
    delay = system.delay_s / period_s
    if not exact:
        none = np.zeros_like(r)
        return PoleResponse(p, r, r, none, p, delay + 0.5, integrators, exact=False)
    from bayeshaptic.stability.responses.response_kernel import held

    whole = np.floor(delay)
    direct, late, centre = np.empty((3, *p.shape), complex)
    held(p, r, delay - whole, direct, late, centre)
    return PoleResponse(p, r, direct, late, centre, whole, integrators, exact=True)


def _simple_poles(
    system: LinearSystem, period_s: float
) -> tuple[Complexes, Complexes, NDArray[np.int_]]:
    """Poles, residues and the number of integrators, with double poles moved apart."""
    link = system.dynamic_links[0] if system.dynamic_links else None
    if link is None:
        parts = transfer(system.mechanism)
    else:
        parts = transfer_with_link(system.mechanism, link)
    top, bottom = (polynomial.T for polynomial in parts)
    numerator, denominator = filtered(top, bottom, system.filters)
    poles = _poles(system, bottom)
    poles = np.take_along_axis(poles, np.argsort(np.abs(poles), axis=1), axis=1)
    integrators = np.cumprod(denominator == 0, axis=0).sum(axis=0)
    at_zero = np.arange(poles.shape[1]) < integrators[:, None]
    poles[at_zero] = 0.0
    slow = 1e-10  # radians a sample: what a pole at zero may be moved by
    poles = moved_apart(poles, slow / period_s)
    # Nothing may sit on the line where the response is read.
    poles.real = np.where((poles.real == 0) & ~at_zero, -1e-14 * np.abs(poles), poles.real)
    return poles, residues(numerator, denominator[-1], poles), integrators


def _poles(system: LinearSystem, denominator: Polynomial) -> Complexes:
    """Poles, shape (B, n): roots of the mechanism's `denominator` and of the filters'.

    Eigenvalues where these do not settle; with a link nan.
    """
    from bayeshaptic.numerics.polynomials.roots import find_roots

    factors = [denominator, *(f.denominator for f in system.filters)]
    degrees = [len(factor) - 1 for factor in factors]
    poles = np.empty((system.batch, sum(degrees)), complex)
    settled = np.ones((len(factors), system.batch), bool)
    for factor, end, degree, fine in zip(
        factors, np.cumsum(degrees), degrees, settled, strict=True
    ):
        own = np.empty((system.batch, degree), complex)
        find_roots(np.ascontiguousarray(factor.T), own, fine)
        poles[:, end - degree : end] = own
    unsettled = np.flatnonzero(~settled.all(axis=0))
    if system.dynamic_links:
        poles[unsettled] = np.nan
    elif unsettled.size:
        poles[unsettled] = system.rows(unsettled).poles()[0]
    return poles
