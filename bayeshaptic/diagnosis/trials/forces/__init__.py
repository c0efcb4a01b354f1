"""Trying internal forces on one recording: their motion, their fit, their search."""
