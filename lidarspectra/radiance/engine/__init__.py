"""Radiance's programs, their options, and what they answer."""
