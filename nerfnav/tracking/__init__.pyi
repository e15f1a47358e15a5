from .frame import Frame as Frame
from .frame import FrameSource as FrameSource
from .frame import Inertial as Inertial
from .status import TrackStatus as TrackStatus
from .tracked import Tracked as Tracked
from .tracker import Tracker as Tracker
from .tracker_config import TrackerConfig as TrackerConfig
