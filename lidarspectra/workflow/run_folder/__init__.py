"""A run's folder: its stages' records, what they depend on, and what is read back from them."""
