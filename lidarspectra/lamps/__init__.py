"""Lamps: shape, flux and distribution, without a word of Radiance."""
