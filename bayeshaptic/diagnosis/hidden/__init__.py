"""What could hide: effects too small to be seen, and the limit that allows for them."""
