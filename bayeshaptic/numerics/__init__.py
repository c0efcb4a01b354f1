"""Arithmetic that knows nothing of haptics: least squares, mixtures, chains, polynomials."""
