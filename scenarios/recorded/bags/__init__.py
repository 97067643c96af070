"""Bags of ROS as recordings."""
