"""Files: atomic writing, locks, NetCDF and TOML."""
