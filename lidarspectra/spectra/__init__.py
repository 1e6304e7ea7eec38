"""Spectra, channels, colours and the databases of them."""
