"""Few objects, one by one: what arrays do for many takes longer than a loop for a handful."""
