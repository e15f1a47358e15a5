"""Stand-in for rclpy: ten pictures a second of a vehicle that follows the trajectory it is sent."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from messages import check, class_of
from sensor_msgs.msg import Image
from vehicle import Vehicle

from nerfnav.live.answer import Guidance, Order, Setpoint

_PERIOD, _MOST = 0.1, 60
_AT_GOAL = 0.09


def init() -> None:
    pass


def create_node(name: str) -> "Node":
    return Node(name)


class Node:
    def __init__(self, name: str) -> None:
        self.name, self.time, self.vehicle = name, 100.0, Vehicle()
        self.sent: dict[str, Any] = {}
        self.received: Callable[[Any], None] | None = None

    def create_publisher(self, kind: Any, topic: str, depth: int) -> Any:
        def publish(message: Any) -> None:
            assert isinstance(message, kind)
            check(message)
            self.sent[topic] = message

        return SimpleNamespace(publish=publish)

    def create_subscription(self, kind: Any, topic: str, received: Callable[[Any], None], depth: int) -> None:
        assert (kind, topic, depth) == (Image, "image", 1)
        self.received = received

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(1e9 * self.time)))

    def get_logger(self) -> Any:
        return SimpleNamespace(info=print)

    def picture(self) -> Any:
        pixels = self.vehicle.picture()
        stamp = class_of("builtin_interfaces/msg/Time")(sec=int(self.time), nanosec=round(self.time % 1 * 1e9))
        header = class_of("std_msgs/msg/Header")(stamp=stamp, frame_id="camera")
        height, width, _ = pixels.shape
        return Image(
            header=header, height=height, width=width, encoding="rgb8", step=3 * width, data=pixels.reshape(-1)
        )  # fmt: skip


def spin(node: Node) -> None:
    """Until the vehicle is at rest near where it was sent, or for so many pictures."""
    assert node.received is not None
    for _ in range(_MOST):
        node.sent.clear()
        node.received(node.picture())
        estimate, points = node.sent.get("estimate"), node.sent["command/trajectory"].points
        told = (
            {}
            if estimate is None
            else {"estimate": _vector(estimate.pose.pose.position), "variance": float(estimate.pose.covariance[0])}
        )
        node.vehicle.record(points=len(points), **told)
        if len(points) == 1:
            return
        if points:
            node.vehicle.follow(_guidance(points, node.time), node.time + _PERIOD)
        node.time += _PERIOD


def _guidance(points: list[Any], time: float) -> Guidance:
    """The trajectory of a message."""
    return Guidance(Order.FOLLOW, "", tuple(
        Setpoint(
            time + point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec,
            _vector(point.transforms[0].translation), _vector(point.velocities[0].linear),
            _vector(point.accelerations[0].linear), _yaw(point.transforms[0].rotation),
        )
        for point in points
    ))  # fmt: skip


def _vector(message: Any) -> tuple[float, float, float]:
    return message.x, message.y, message.z


def _yaw(quaternion: Any) -> float:
    import math

    return 2 * math.atan2(quaternion.z, quaternion.w)
