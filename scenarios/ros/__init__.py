"""ROS messages and bags: what perception takes from them, read without ROS."""
