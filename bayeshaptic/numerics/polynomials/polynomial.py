"""Polynomials in s with a batch of coefficients: arrays of shape (degree + 1, B), lowest first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Polynomial = NDArray[np.float64]


def multiply(a: Polynomial, b: Polynomial) -> Polynomial:
    """The product of two polynomials."""
    if len(a) > len(b):
        a, b = b, a
    out = np.zeros((len(a) + len(b) - 1, max(a.shape[1], b.shape[1])))
    for power, coefficient in enumerate(a):
        out[power : power + len(b)] += coefficient * b
    return out


def add(a: Polynomial, b: Polynomial) -> Polynomial:
    """The sum of two polynomials."""
    if len(a) < len(b):
        a, b = b, a
    out = np.array(np.broadcast_to(a, (len(a), max(a.shape[1], b.shape[1]))))
    out[: len(b)] += b
    return out


def evaluate(polynomial: Polynomial, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Values of shape (..., B) at points `s` of shape (..., 1) or (..., B), by Horner's rule."""
    value = np.zeros(np.broadcast_shapes(s.shape, polynomial.shape[1:]), complex)
    for coefficient in polynomial[::-1]:
        value = value * s + coefficient
    return value


def roots(polynomial: Polynomial) -> NDArray[np.complex128]:
    """Roots of a batch of polynomials, shape (B, degree).

    By the companion matrix; of one and two roots, as filters have them, in closed form.
    """
    degree = len(polynomial) - 1
    if degree == 0:
        return np.zeros((polynomial.shape[1], 0), complex)
    monic = polynomial[:-1] / polynomial[-1]
    if degree == 1:
        return -monic.T.astype(complex)
    if degree == 2:
        return _two_roots(*monic)
    companion = np.zeros((polynomial.shape[1], degree, degree))
    companion[:, np.arange(1, degree), np.arange(degree - 1)] = 1.0
    companion[:, :, -1] = -monic.T
    return np.linalg.eigvals(companion).astype(complex)


def _two_roots(c: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Roots of s^2 + b s + c, shape (B, 2), neither by a difference of nearly equal numbers."""
    with np.errstate(all="ignore"):  # of a fit far off: no number, and no warning
        half = 0.5 * b
        discriminant = half * half - c
        root = np.sqrt(discriminant.astype(complex))
        larger = -half - np.where(half < 0, -root, root)
        some = np.where(larger == 0, 1.0, larger)
        smaller = np.where(discriminant < 0, np.conj(larger), np.where(larger == 0, 0.0, c / some))
    return np.stack([larger, smaller], axis=1)
