"""Facts of the raw signals: excitation, causality, rounding, timing."""
