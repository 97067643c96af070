"""Training of learned detectors, and the files that come of it."""
