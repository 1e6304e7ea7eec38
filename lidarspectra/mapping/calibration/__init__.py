"""Lamp fluxes, reflectances and meter factors from a few readings."""
