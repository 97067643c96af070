"""Point clouds in files: KITTI and nuScenes (.bin, .pcd.bin), PCD, NumPy and bags of ROS."""
