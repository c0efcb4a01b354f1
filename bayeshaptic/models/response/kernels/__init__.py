"""Inner loops, compiled; imported by the functions that call them."""
