"""Monitored areas: which objects count."""
