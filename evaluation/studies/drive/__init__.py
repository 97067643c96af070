"""Recorded drives in open loop: what is decided on them, and what can be said of it."""
