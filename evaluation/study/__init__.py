"""The comparison of strategies over scenes: avoidance against false stops."""
