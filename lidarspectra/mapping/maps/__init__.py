"""Spectral maps and what is computed from them."""
