"""Strategies, settings and brake rules side by side on recorded drives."""
