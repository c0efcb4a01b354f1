"""From a measurement to the base model that an analysis, or the loop, goes on with."""
