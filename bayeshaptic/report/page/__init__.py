"""What a page says besides its figures and tables: first screen, lights, methods, provenance."""
