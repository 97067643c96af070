"""Runs and drives written as data sets, with the clouds of a LiDAR."""
