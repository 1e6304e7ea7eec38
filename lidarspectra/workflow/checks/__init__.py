"""What is checked of a run file before anything is made: its files, places and numbers."""
