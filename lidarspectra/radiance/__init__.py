"""Everything that knows Radiance; nothing else does (paper, Sections 2.4.4 and 3.1)."""
