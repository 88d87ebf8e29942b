"""The node of ROS 2 behind `bsg-ros`."""
