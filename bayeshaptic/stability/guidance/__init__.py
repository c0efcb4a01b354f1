"""What moves the limit: shares of the uncertainty, elasticities, sweeps."""
