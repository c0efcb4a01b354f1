"""The measured frequency response: estimates, their spectra, and the windows of the likelihood."""
