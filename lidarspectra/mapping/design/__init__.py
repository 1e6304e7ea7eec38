"""Inverse lighting: from targets of light to the dimming, the spectra and the places of lamps."""
