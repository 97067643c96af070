"""Studies: each is a list of runs, a job and its tables."""
