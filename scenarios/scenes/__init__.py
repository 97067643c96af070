"""Scenes of the comparison: what must make the ego brake, and what must not."""
