"""Figures of stable walls."""
