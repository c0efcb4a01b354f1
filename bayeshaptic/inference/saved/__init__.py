"""Posteriors in files, groups as ArviZ has them in netCDF; and states of samplers."""
