"""Measurements of speed and of what explains the results; each module runs by `python -m`."""
