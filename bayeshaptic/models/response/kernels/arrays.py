"""The arrays that `rational.py` beside it reads."""

from __future__ import annotations

from typing import NamedTuple

from bayeshaptic.types import Floats, Ints


class RationalArrays(NamedTuple):
    """A batch of rational loops, ready to be evaluated at some nodes.

    Attributes
    ----------
    numerator, denominator : ndarray, shape (B, 2, n)
        In powers of sT, the denominator's leading coefficient one: even and odd powers with the
        signs of j^p, padded with zeros.
    series : ndarray, shape (B, ORDER + 1)
        h_q T^q of P(s) = sum_q h_q s^-q for large s.
    turns : ndarray, shape (B,)
        Delay in periods.
    pole_count : ndarray of int, shape (B,)
        How many poles are to be added in the closed form; negative where they are all there is.
    poles : ndarray, shape (B, N, 3, 2)
        Of these poles: numerators without and with a further z^-1, and what is subtracted from
        z - 1; real and imaginary parts.
    theta : ndarray, shape (L,)
        Angles w T of the nodes.
    hold : ndarray, shape (2, L)
        1 - e^{-j theta}, real and imaginary part.
    high : ndarray of int
        Nodes where the nearest aliases are taken by themselves.
    bernoulli, binomials, economy : ndarray
        See `alias_tables.alias_tables`.
    """

    numerator: Floats
    denominator: Floats
    series: Floats
    turns: Floats
    pole_count: Ints
    poles: Floats
    theta: Floats
    hold: Floats
    high: Ints
    bernoulli: Floats
    binomials: Floats
    economy: Floats


class WindowArrays(NamedTuple):
    """The windows of a likelihood, for nodes in the order (k, W).

    Attributes
    ----------
    design_re, design_im : ndarray, shape (r, k, W)
        R.
    target_re, target_im : ndarray, shape (r, W)
        z.
    scatter : ndarray, shape (W,)
        s0.
    weight : ndarray, shape (W,)
        n - 1; 0 for windows that only fill the vector.
    triangular : bool
        Whether there are three nodes, and R has zeros below its diagonal.
    """

    design_re: Floats
    design_im: Floats
    target_re: Floats
    target_im: Floats
    scatter: Floats
    weight: Floats
    triangular: bool


class Space(NamedTuple):
    """What the responses of some rows with one delay, R at most, are made in.

    Attributes
    ----------
    matrix, far_matrix : ndarray, shape (ORDER + 1, ORDER)
        From the series in 1/s to that over all aliases, and to that without the nearest ones.
    tail, far_tail : ndarray, shape (R, ORDER)
        Coefficients of these series: even powers, then odd ones.
    poles : ndarray, shape (2, L)
        The closed form of a row's poles.
    begun : ndarray, shape (4, L)
        Higher powers of numerator and denominator; zeros where there are none.
    factor : ndarray, shape (2, L)
        Hold and delay.
    response : ndarray, shape (R, 2, L)
    turns : ndarray, shape (1,)
        The delay that the matrices and `factor` are of; nan before the first.
    """

    matrix: Floats
    far_matrix: Floats
    tail: Floats
    far_tail: Floats
    poles: Floats
    begun: Floats
    factor: Floats
    response: Floats
    turns: Floats
