"""Stand-in for MAVSDK: an autopilot that writes down what it is told."""

from dataclasses import asdict
from typing import Any

from mavsdk.mocap import VisionPositionEstimate
from vehicle import Vehicle


class System:
    def __init__(self) -> None:
        self._vehicle = Vehicle()
        self.mocap = self.offboard = self.action = self

    async def connect(self, system_address: str) -> None:
        assert system_address == "udpin://0.0.0.0:14540"

    async def set_vision_position_estimate(self, estimate: VisionPositionEstimate) -> None:
        self._vehicle.record(estimate=asdict(estimate))

    async def set_position_velocity_acceleration_ned(self, position: Any, velocity: Any, acceleration: Any) -> None:
        self._vehicle.record(setpoint=[asdict(part) for part in (position, velocity, acceleration)])

    async def start(self) -> None:
        self._vehicle.record(mode="offboard")

    async def hold(self) -> None:
        self._vehicle.record(mode="hold")
