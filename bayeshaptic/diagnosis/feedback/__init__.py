"""Recordings whose force was computed from the motion."""
