"""From threats to a brake command."""
