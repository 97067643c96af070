"""Comparisons: suites of runs, scores, tables, pictures and the command line."""
