"""The vehicle behind the stand-ins: it follows setpoints exactly, and its camera shows the field from where it is."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.field import render_image
from nerfnav.geometry import so3
from nerfnav.live.answer import Guidance
from nerfnav.live.setpoints import predict_guided
from nerfnav.robots import Quadrotor, RigidState

PLACE, START, GOAL = "playground", (-0.07, 0.93, 0.28), (-0.1, 0.0, 0.35, 0.0)
"""Where it is, and where it is to go."""
CAMERA, ROBOT = nerfnav.Camera.from_fov(320, 240, 90), Quadrotor()
YAW = float(scenes.load(PLACE).tasks[6].start_yaw)


class Vehicle:
    """Where it truly is, and what was commanded, written to a file as it happens."""

    def __init__(self) -> None:
        self.state = RigidState.at_rest(START, YAW)
        self._field = nerfnav.load_field(scenes.trained_path(PLACE))
        self._record = Path(os.environ["STAND_IN_RECORD"])

    def picture(self) -> np.ndarray:
        """RGB."""
        return render_image(self._field, CAMERA, self.state.pose.compose(ROBOT.mount)).image.numpy()

    def follow(self, guidance: Guidance, time: float) -> None:
        """Be where guidance wants it at a time."""
        there = predict_guided(guidance, time, flies=True)
        assert there is not None
        self.state = there

    def record(self, **told: Any) -> None:
        """One line of what happens."""
        truth = {"truth": self.state.position.tolist(), "yaw": float(so3.yaw_of(self.state.rotation))}
        with self._record.open("a") as stream:
            stream.write(json.dumps(truth | told) + "\n")
