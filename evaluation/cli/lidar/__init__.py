"""The commands `smartmot-eval lidar ...`: clouds and boxes of LiDARs."""
