"""Tracking on recorded data, scored against labels. See docs/mot.md."""
