"""Arithmetic that knows nothing of haptics: least squares, mixtures, roots, polynomials."""
