"""What the map gains when detections come from a LiDAR."""

from evaluation.studies.answers.lidar.question import LidarGain

__all__ = ["LidarGain"]
