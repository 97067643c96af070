"""Films from above: of a run with what happens in words, and of the tracks of a recording."""
