"""Glass, mirrors and screens in a scan: what is taken for them, and how the scan is mended where they are."""
