"""Perception of a stream of ROS messages, one at a time: what a bag and the live node have in common."""
