"""ROS 2 node: send pictures to `nerfnav live`, and publish the vehicle's pose and its trajectory to a goal.

nerfnav live place.npz --robot x500 --camera camera.yaml --token T
python ros2_node.py "ws://127.0.0.1:8090/?token=T" --goal 1 2 1.5 0
"""

import argparse

from nerfnav.live import Goal, LiveClient
from nerfnav.tracking import decode_image_message


def main(address: str, goal: Goal, topic: str) -> None:
    """Run until Ctrl-C. Publish `estimate` and `command/trajectory` in the frame `map`."""
    import rclpy  # pyright: ignore[reportMissingImports]
    from geometry_msgs.msg import PoseWithCovarianceStamped, Transform, Twist  # pyright: ignore[reportMissingImports]
    from rclpy.duration import Duration  # pyright: ignore[reportMissingImports]
    from sensor_msgs.msg import Image  # pyright: ignore[reportMissingImports]
    from trajectory_msgs.msg import (  # pyright: ignore[reportMissingImports]
        MultiDOFJointTrajectory,
        MultiDOFJointTrajectoryPoint,
    )

    rclpy.init()
    node, live, held = rclpy.create_node("nerfnav"), LiveClient(address), False
    estimates = node.create_publisher(PoseWithCovarianceStamped, "estimate", 10)
    trajectories = node.create_publisher(MultiDOFJointTrajectory, "command/trajectory", 10)

    def now() -> float:
        return 1e-9 * node.get_clock().now().nanoseconds

    def on_image(image: Image) -> None:
        nonlocal held
        time = image.header.stamp.sec + 1e-9 * image.header.stamp.nanosec
        answer = live.see(decode_image_message(image).numpy(), time, goal, now(), held)
        guidance = answer.guidance_at(now())
        held = guidance is None or not guidance.setpoints
        if answer.position and answer.quaternion and answer.covariance:
            stamped = PoseWithCovarianceStamped()
            stamped.header.stamp, stamped.header.frame_id = image.header.stamp, "map"
            at, turned = stamped.pose.pose.position, stamped.pose.pose.orientation
            (at.x, at.y, at.z), (turned.w, turned.x, turned.y, turned.z) = answer.position, answer.quaternion
            stamped.pose.covariance = [number for row in answer.covariance for number in row]
            estimates.publish(stamped)
        command = MultiDOFJointTrajectory()  # without points: hold
        command.header.stamp, command.header.frame_id = image.header.stamp, "map"
        for setpoint in guidance.setpoints if guidance else ():
            pose, moves, pushed = Transform(), Twist(), Twist()
            at, turned = pose.translation, pose.rotation
            (at.x, at.y, at.z), (turned.w, turned.z) = setpoint.position, setpoint.half_turn
            moves.linear.x, moves.linear.y, moves.linear.z = setpoint.velocity
            pushed.linear.x, pushed.linear.y, pushed.linear.z = setpoint.acceleration
            after = Duration(seconds=max(0.0, setpoint.time - time)).to_msg()
            command.points.append(MultiDOFJointTrajectoryPoint(
                transforms=[pose], velocities=[moves], accelerations=[pushed], time_from_start=after
            ))  # fmt: skip
        trajectories.publish(command)
        order = "" if guidance is None else f"{guidance.order.value}: {guidance.reason}"
        node.get_logger().info(f"{answer.status}, {answer.latency_ms:.0f} ms, {order}")

    node.create_subscription(Image, topic, on_image, 1)  # one in the queue: old pictures are dropped
    rclpy.spin(node)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("address", help="address that `nerfnav live` prints")
    parser.add_argument("--goal", type=float, nargs=4, required=True, help="x y z [m] and heading [rad]")
    parser.add_argument("--topic", default="image", help="topic of sensor_msgs/Image")
    arguments = parser.parse_args()
    x, y, z, yaw = arguments.goal
    main(arguments.address, Goal((x, y, z), yaw), arguments.topic)
