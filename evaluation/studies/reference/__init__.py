"""The reference results: which runs they consist of, how they are made, checked and told."""
