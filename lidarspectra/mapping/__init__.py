"""From traced numbers to answers: maps, metrics, figures and the report (paper, Section 3.3)."""
