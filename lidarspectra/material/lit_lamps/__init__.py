"""Lamps that are lit in a scan: found by their picture, and their relative fluxes by the light on the walls."""
