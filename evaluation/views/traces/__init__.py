"""Runs as files of other tools: MCAP for Foxglove, Lichtblick and rerun, and ground truth of ASAM OSI."""
