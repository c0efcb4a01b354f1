"""Everything between the commanded force and the sampled position, for a batch of vectors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bayeshaptic.models.response.dynamic_link import DynamicLink, Index
from bayeshaptic.models.response.filter import Filter
from bayeshaptic.models.response.filtered import behind_fast_filters, fast_filters
from bayeshaptic.models.response.mechanism import Mechanism
from bayeshaptic.models.response.remainder import Remainder, remainder_of, sampled_remainder
from bayeshaptic.models.response.sampled import from_poles, from_polynomials
from bayeshaptic.numerics.polynomial import Polynomial, evaluate, multiply, roots
from bayeshaptic.types import Complexes, Floats

_CHUNK = 128  # vectors at a time: the arrays of one chunk stay in the cache


@dataclass(frozen=True)
class LinearSystem:
    """Mechanism, loop delay and filters of a batch of parameter vectors.

    Attributes
    ----------
    mechanism : Mechanism
    delay_s : ndarray, shape (B,)
    filters : tuple of Filter
        Rational factors before or after the mechanism (they commute).
    dynamic_links : tuple of DynamicLink
        Further forces inside the mechanism, not rational in s.
    """

    mechanism: Mechanism
    delay_s: Floats
    filters: tuple[Filter, ...] = ()
    dynamic_links: tuple[DynamicLink, ...] = ()

    @property
    def batch(self) -> int:
        return self.mechanism.batch

    @property
    def rational(self) -> bool:
        """Whether mechanism and filters are all there is: finitely many poles."""
        return not self.dynamic_links

    @property
    def rational_part(self) -> LinearSystem:
        """The same without its dynamic links."""
        return replace(self, dynamic_links=()) if self.dynamic_links else self

    @property
    def remainder(self) -> Remainder:
        """What the dynamic links add to the rational part."""
        return remainder_of(self.mechanism, self.dynamic_links, self.filters)

    def with_filter(self, numerator: Polynomial, denominator: Polynomial) -> LinearSystem:
        return replace(self, filters=(*self.filters, Filter(numerator, denominator)))

    def with_dynamic_link(self, link: DynamicLink) -> LinearSystem:
        return replace(self, dynamic_links=(*self.dynamic_links, link))

    def rows(self, index: Index) -> LinearSystem:
        """A part of the batch."""
        mechanism = self.mechanism
        links = tuple(
            replace(link, damping=link.damping[index], stiffness=link.stiffness[index])
            for link in mechanism.links
        )
        masses = tuple(mass[index] for mass in mechanism.masses)
        return replace(
            self,
            mechanism=replace(mechanism, masses=masses, links=links),
            delay_s=self.delay_s[index],
            filters=tuple(factor.rows(index) for factor in self.filters),
            dynamic_links=tuple(link.rows(index) for link in self.dynamic_links),
        )

    def transfer(self) -> tuple[Polynomial, Polynomial]:
        """Numerator and denominator of the rational part, continuous, without the delay."""
        numerator, denominator = self.mechanism.transfer()
        for factor in self.filters:
            numerator = multiply(numerator, factor.numerator)
            denominator = multiply(denominator, factor.denominator)
        return numerator, denominator

    def poles(self) -> tuple[Complexes, Complexes]:
        """Poles and residues of the rational part without the delay, each of shape (B, n).

        The residues assume simple poles; beside a double pole they blow up (`sampled_response`
        does not use them there).
        """
        poles = [_eigenvalues(self.mechanism.state_matrix())]
        for factor in self.filters:
            poles.append(roots(factor.denominator))
        p = np.concatenate(poles, axis=1)
        numerator, denominator = self.transfer()
        gaps = p[:, :, None] - p[:, None, :]
        gaps[:, np.arange(p.shape[1]), np.arange(p.shape[1])] = 1.0
        with np.errstate(divide="ignore", invalid="ignore"):
            residues = evaluate(numerator, p.T).T / (denominator[-1][:, None] * gaps.prod(axis=2))
        return p, residues

    def continuous_response(self, s: Complexes) -> Complexes:
        """P(s) without hold and delay at points `s` of shape (L,); shape (B, L)."""
        numerator, denominator = self.transfer()
        points = np.asarray(s, complex)[:, None]
        response = evaluate(numerator, points) / evaluate(denominator, points)
        if self.dynamic_links:
            response = response + self.remainder.at(points)
        return np.asarray(response.T)

    def continuous_approximation(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """P(s) e^{-s (td + T/2)}, the paper's stand-in for the sampled response; shape (B, L)."""
        s = 2j * np.pi * np.asarray(frequency_hz, float)
        return self.continuous_response(s) * np.exp(-s * (self.delay_s[:, None] + period_s / 2))

    def sampled_response(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """The exact sampled response at frequencies of shape (L,); shape (B, L)."""
        frequency_hz = np.asarray(frequency_hz, float)
        out = np.empty((self.batch, len(frequency_hz)), complex)
        for start in range(0, self.batch, _CHUNK):
            rows = slice(start, min(start + _CHUNK, self.batch))
            out[rows] = self._chunk_response(rows, frequency_hz, period_s)
        return out

    def _chunk_response(self, rows: slice, frequency_hz: Floats, period_s: float) -> Complexes:
        part = self.rows(rows) if self.batch > _CHUNK else self
        response = part._rational_response(frequency_hz, period_s)
        if part.dynamic_links:
            response += sampled_remainder(part.remainder, part.delay_s, frequency_hz, period_s)
        return response

    def _rational_response(self, frequency_hz: Floats, period_s: float) -> Complexes:
        """The rational part, by the fastest way that holds for each row."""
        fast = fast_filters(self.filters, self.batch, period_s)
        if fast.any() and not fast.all():
            response = np.empty((self.batch, len(frequency_hz)), complex)
            for part in (fast, ~fast):
                response[part] = self.rows(part)._rational_response(frequency_hz, period_s)
            return response
        if fast.any():
            response, good = behind_fast_filters(
                self.mechanism, self.filters, self.delay_s, frequency_hz, period_s
            )
        else:
            numerator, denominator = self.transfer()
            response, good = from_polynomials(
                numerator, denominator, self.delay_s, frequency_hz, period_s
            )
        if not good.all():
            bad = self.rows(~good)
            response[~good] = from_poles(*bad.poles(), bad.delay_s, frequency_hz, period_s)
        return response


def _eigenvalues(matrices: Floats) -> Complexes:
    """Eigenvalues of a batch; nan for parameters so far away that a matrix overflows."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    values = np.full(matrices.shape[:2], np.nan, complex)
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values
