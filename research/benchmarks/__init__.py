"""Scripts that print the numbers of README and docs."""
