"""What a run file asks for, from scan to report: read `pipeline` first."""
