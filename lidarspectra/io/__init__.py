"""Whole files, locks, NetCDF and TOML."""
