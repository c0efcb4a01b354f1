"""Trying what could explain a residual."""
