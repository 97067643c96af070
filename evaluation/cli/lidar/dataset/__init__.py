"""`smartmot-eval lidar dataset`: data sets of labelled clouds."""
