"""Figures of what moves the limit."""
