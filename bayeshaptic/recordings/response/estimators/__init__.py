"""Estimators of the response: by the kind of excitation, and through a reference."""
