"""Runs on other machines: what travels to the workers of a scheduler, and what they must have in common."""
