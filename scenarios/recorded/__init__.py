"""Recorded drives: readers of data sets and tables of detections, labels and poses."""
