"""Files for other programs: the lit room as glTF and USDZ, maps and room as VTK."""
