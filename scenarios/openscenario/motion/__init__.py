"""How entities move: paths, positions on roads, speed profiles."""
