"""The section about where the uncertainty comes from and what to do next."""
