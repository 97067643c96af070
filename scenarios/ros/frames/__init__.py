"""Where vehicle and sensor are at a time: transforms, odometry, both together."""
