"""The report of a run: what goes into its page."""
