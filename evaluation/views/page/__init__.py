"""A folder of runs as one HTML page, and a run as a film."""
