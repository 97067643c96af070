"""The comparison of strategies over scenes: collisions avoided against false activations."""
