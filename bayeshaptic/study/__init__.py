"""The analysis of a study: recordings, cases, configurations, the limit of the device."""
