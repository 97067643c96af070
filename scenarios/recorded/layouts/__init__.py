"""Recordings written as data sets in the layouts of others, whose tools then read them."""
