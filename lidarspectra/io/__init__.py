"""Files: atomic writing, locks, NetCDF, arrays and TOML."""
