"""Lamp fluxes, reflectances and meter factors told by a few readings."""
