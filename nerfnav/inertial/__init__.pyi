from . import inertial_motion as inertial_motion
from .imu import ImuConfig as ImuConfig
from .imu import ImuNoise as ImuNoise
from .strapdown import Increments as Increments
from .strapdown import integrate_step as integrate_step
from .strapdown import propagate_state as propagate_state
