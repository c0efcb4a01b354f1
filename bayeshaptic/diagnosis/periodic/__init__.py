"""The loop on periodic recordings: line spectra and harmonic balance."""
