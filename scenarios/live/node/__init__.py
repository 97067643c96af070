"""`smartmot-ros`: perception as a live node of ROS 2."""
