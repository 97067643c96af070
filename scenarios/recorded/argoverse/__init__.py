"""Argoverse 2: logs and vector maps."""
