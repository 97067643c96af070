"""Bags read without ROS: SQLite and MCAP of ROS 2, the bags of ROS 1."""
