"""People and configurations: what the recordings of one device have in common."""
