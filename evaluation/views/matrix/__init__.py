"""Matrices of scored cells as text, picture and HTML."""
