"""Stand-in."""

from messages import class_of

_Message = class_of("builtin_interfaces/msg/Duration")


class Duration:
    def __init__(self, seconds: float) -> None:
        self.nanoseconds = round(1e9 * seconds)

    def to_msg(self) -> object:
        return _Message(sec=self.nanoseconds // 10**9, nanosec=self.nanoseconds % 10**9)
