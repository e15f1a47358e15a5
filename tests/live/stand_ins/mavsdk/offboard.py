"""Stand-in, with the parameters of MAVSDK-Python."""

from dataclasses import dataclass


@dataclass
class PositionNedYaw:
    north_m: float
    east_m: float
    down_m: float
    yaw_deg: float


@dataclass
class VelocityNedYaw:
    north_m_s: float
    east_m_s: float
    down_m_s: float
    yaw_deg: float


@dataclass
class AccelerationNed:
    north_m_s2: float
    east_m_s2: float
    down_m_s2: float
