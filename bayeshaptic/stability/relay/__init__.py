"""Relay experiments: a second witness of the critical stiffness."""
