"""Which signal drives which: predictions of one from the other's past."""
