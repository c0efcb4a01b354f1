"""From a measurement to everything a report shows: analysis, residual, tracing."""
