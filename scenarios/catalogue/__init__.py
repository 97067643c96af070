"""The shipped tests: scenario files, maps and how to place them."""
