"""Maps for recordings."""
