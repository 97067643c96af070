"""OpenDRIVE files, read and written."""
