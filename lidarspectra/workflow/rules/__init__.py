"""A run's light against rules, each requirement with its probability."""
