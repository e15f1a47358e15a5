"""Stand-in, with the parameters of MAVSDK-Python."""

from dataclasses import dataclass


@dataclass
class PositionBody:
    x_m: float
    y_m: float
    z_m: float


@dataclass
class AngleBody:
    roll_rad: float
    pitch_rad: float
    yaw_rad: float


@dataclass
class Covariance:
    covariance_matrix: list[float]


@dataclass
class VisionPositionEstimate:
    time_usec: int
    position_body: PositionBody
    angle_body: AngleBody
    pose_covariance: Covariance
