"""What the map gains when detections come from a LiDAR, and what a network changes."""

from evaluation.studies.answers.lidar.question import LearnedGain, LidarGain

__all__ = ["LearnedGain", "LidarGain"]
