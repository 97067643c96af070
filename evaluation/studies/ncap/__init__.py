"""Grids of Euro NCAP and UNECE: which runs they ask for, whether each run was one, the score."""
