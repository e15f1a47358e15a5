"""ROS 2: a flight or a plan as standard messages, in MCAP and in rosbag2."""
