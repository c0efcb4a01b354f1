"""Which rows there are, when each was written down, and for how many a signal stands."""
