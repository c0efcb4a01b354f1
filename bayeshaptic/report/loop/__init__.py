"""What closing the loop found, in words and tables."""
