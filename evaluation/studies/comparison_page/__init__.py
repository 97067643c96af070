"""The page of a comparison: of `compare`, of `compare --drives`, and of a question of `study`."""
