"""Stand-in."""

from messages import class_of

PoseWithCovarianceStamped = class_of("geometry_msgs/msg/PoseWithCovarianceStamped")
Transform = class_of("geometry_msgs/msg/Transform")
Twist = class_of("geometry_msgs/msg/Twist")
