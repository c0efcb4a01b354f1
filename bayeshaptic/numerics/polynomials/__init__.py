"""Polynomials with a batch of coefficients: arithmetic, roots, partial fractions."""
