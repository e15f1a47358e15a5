"""Stand-in."""

from messages import class_of

MultiDOFJointTrajectory = class_of("trajectory_msgs/msg/MultiDOFJointTrajectory")
MultiDOFJointTrajectoryPoint = class_of("trajectory_msgs/msg/MultiDOFJointTrajectoryPoint")
