"""Stand-in."""

from messages import class_of

Image = class_of("sensor_msgs/msg/Image")
