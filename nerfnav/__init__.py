"""Robots that navigate inside radiance fields.

A Scene is captured into images; images train a Field; a Robot turns flat outputs into motion; the planner bends
a Trajectory through the Field; the simulator moves the truth; the filter turns a picture into a Belief; the loop
joins them into an Episode. This package holds no scene names, no command line, no viewer, no prints, no threads.

What most scripts need is here by name, as in `nerfnav.plan`; a name is imported when it is first used (PEP 562), so
that `import nerfnav` takes no time.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

# Idle OpenMP threads of torch and of numba spin against each other unless told to sleep (a training step beside
# a busy process: 34 ms against 2 ms); the libraries read this when they are loaded, so it stands before them.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

__version__ = "0.1.0"

if TYPE_CHECKING:
    from nerfnav.api import fly as fly
    from nerfnav.api import plan as plan
    from nerfnav.errors import NerfnavError as NerfnavError
    from nerfnav.estimator.belief import Belief as Belief
    from nerfnav.estimator.fast import FastFilter as FastFilter
    from nerfnav.estimator.filter import PoseFilter as PoseFilter
    from nerfnav.estimator.noise import StateNoise as StateNoise
    from nerfnav.export.formats import FORMATS as FORMATS
    from nerfnav.export.recording import Recording as Recording
    from nerfnav.field.checkpoint import load_field as load_field
    from nerfnav.field.checkpoint import save_field as save_field
    from nerfnav.field.composite import CompositeField as CompositeField
    from nerfnav.field.composite import PlacedField as PlacedField
    from nerfnav.field.field import Field as Field
    from nerfnav.field.train import TrainConfig as TrainConfig
    from nerfnav.field.train import train as train
    from nerfnav.field.voxel import VoxelField as VoxelField
    from nerfnav.geometry.camera import Camera as Camera
    from nerfnav.geometry.camera import Pose as Pose
    from nerfnav.navigation.episode import Episode as Episode
    from nerfnav.planner.problem import PlanProblem as PlanProblem
    from nerfnav.planner.steps import PlanOutcome as PlanOutcome
    from nerfnav.planner.terms.term import CostTerm as CostTerm
    from nerfnav.planner.trajectory import Trajectory as Trajectory
    from nerfnav.robots.couch import Couch as Couch
    from nerfnav.robots.diffdrive import DiffDrive as DiffDrive
    from nerfnav.robots.quadrotor import Quadrotor as Quadrotor
    from nerfnav.robots.robot import Robot as Robot
    from nerfnav.robots.state import Motion as Motion
    from nerfnav.robots.state import RigidState as RigidState
    from nerfnav.world.contact import judge as judge
    from nerfnav.world.scene import Scene as Scene

_HOMES = {
    "fly": "nerfnav.api",
    "plan": "nerfnav.api",
    "NerfnavError": "nerfnav.errors",
    "Belief": "nerfnav.estimator.belief",
    "FastFilter": "nerfnav.estimator.fast",
    "PoseFilter": "nerfnav.estimator.filter",
    "StateNoise": "nerfnav.estimator.noise",
    "FORMATS": "nerfnav.export.formats",
    "Recording": "nerfnav.export.recording",
    "load_field": "nerfnav.field.checkpoint",
    "save_field": "nerfnav.field.checkpoint",
    "CompositeField": "nerfnav.field.composite",
    "PlacedField": "nerfnav.field.composite",
    "Field": "nerfnav.field.field",
    "TrainConfig": "nerfnav.field.train",
    "train": "nerfnav.field.train",
    "VoxelField": "nerfnav.field.voxel",
    "Camera": "nerfnav.geometry.camera",
    "Pose": "nerfnav.geometry.camera",
    "Episode": "nerfnav.navigation.episode",
    "PlanProblem": "nerfnav.planner.problem",
    "PlanOutcome": "nerfnav.planner.steps",
    "CostTerm": "nerfnav.planner.terms.term",
    "Trajectory": "nerfnav.planner.trajectory",
    "Couch": "nerfnav.robots.couch",
    "DiffDrive": "nerfnav.robots.diffdrive",
    "Quadrotor": "nerfnav.robots.quadrotor",
    "Robot": "nerfnav.robots.robot",
    "Motion": "nerfnav.robots.state",
    "RigidState": "nerfnav.robots.state",
    "judge": "nerfnav.world.contact",
    "Scene": "nerfnav.world.scene",
}
"""Where each name is made."""


def __getattr__(name: str) -> Any:
    """A name of the front, imported now."""
    if name not in _HOMES:
        raise AttributeError(f"module 'nerfnav' has no attribute {name!r}")
    value = globals()[name] = getattr(import_module(_HOMES[name]), name)
    return value


def __dir__() -> list[str]:
    """All names, imported yet or not."""
    return sorted({*globals(), *_HOMES})
