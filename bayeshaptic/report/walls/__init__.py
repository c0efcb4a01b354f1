"""The section about stable walls."""
