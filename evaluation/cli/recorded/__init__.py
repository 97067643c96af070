"""Commands on recorded data."""
