"""How the posterior is sampled: coordinates, proposals, ensembles."""
