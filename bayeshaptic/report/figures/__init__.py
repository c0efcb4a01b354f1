"""The figures of a report, one module each; `pictures` says which there are."""
