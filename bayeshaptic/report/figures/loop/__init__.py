"""Figures of a closed loop."""
