"""From pictures of surfaces to spectra of surfaces (paper, Section 2.3)."""
