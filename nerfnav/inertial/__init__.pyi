from . import inertial_motion as inertial_motion
from .imu import ImuConfig as ImuConfig
from .imu import ImuNoise as ImuNoise
from .strapdown import Increments as Increments
from .strapdown import advanced as advanced
from .strapdown import moved_on as moved_on
