"""KITTI object labels, results and calibration; boxes between camera and LiDAR."""
