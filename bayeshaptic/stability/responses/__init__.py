"""Responses as the search for crossings reads them."""
