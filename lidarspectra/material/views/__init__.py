"""Views of a scan: where a camera is put, and what it sees (paper, Section 2.3.3)."""
