"""The section about what could hide."""
