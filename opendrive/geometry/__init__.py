"""Curves, profiles, borders: what the numbers of a road draw."""
