"""Lamps for wanted light, from a run's transport."""
