"""What a search for a camera's pose tells."""

from typing import Any

from nerfnav.estimator import RelocaliseStep
from nerfnav.geometry.so3 import quaternion_from_matrix, yaw_of


def summary_of(step: RelocaliseStep) -> dict[str, Any]:
    """What `localize --json` prints: the outcome, and the likeliest poses of the camera's carrier, best first."""
    poses = step.body_poses()
    found = [
        {
            "position_m": poses.position[index].tolist(),
            "yaw_rad": yaw_of(poses.rotation[index]).item(),
            "quaternion_wxyz": quaternion_from_matrix(poses.rotation[index]).tolist(),
            "weight": step.weights[index].item(),
            "difference": step.differences[index].item(),
        }
        for index in range(len(step.weights))
    ]
    assert step.outcome is not None, "the last step of a search has its outcome"
    return {"outcome": step.outcome.name.lower(), "advice": step.outcome.value, **found[0], "candidates": found}
