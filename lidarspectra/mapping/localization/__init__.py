"""Localization: where a person stands, from what fixed sensors read."""
