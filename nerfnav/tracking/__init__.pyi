from .frame import Frame as Frame
from .frame import FrameSource as FrameSource
from .frame import Inertial as Inertial
