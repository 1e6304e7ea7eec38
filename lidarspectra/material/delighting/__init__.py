"""De-lighting: reflectance from a lit picture, by the light of what is known and what is found."""
