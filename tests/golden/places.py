"""Hand-made content of golden files: fields, a flight, a place, a robot, a session, all with every value that they can
hold, none of them a default."""

import json
from typing import Any

import numpy as np
import torch
import trimesh

from tests.golden import product as p

DATE = "2026-01-02T03:04:05+00:00"
"""When everything was made."""
FIELDS = ("voxel", "bricks", "neural")
"""Names of golden fields, one of each codec."""
SESSION_OF = "stonehenge"
"""What the golden session was opened with."""

_BROWN = [64, 48, 51.25, 50.75, 31.5, 24.25, 0.021, -0.013, 0.0011, -0.0007, 0.0031]
_FISHEYE = [80, 60, 41.5, 40.5, 40.25, 29.75, 0.05, -0.02, 0.003, -0.0004, 0.0, 0.0]
_PINHOLE = [100, 80, 70.5, 70.25, 50.5, 39.5]
_CAMERAS = {"voxel": _FISHEYE, "bricks": _BROWN, "neural": _PINHOLE}


def info_of(name: str, truth: str = "", sha256: str = "") -> dict[str, Any]:
    """Everything that a field's file can say of it, by the names in the file."""
    generator = torch.Generator().manual_seed(len(name))
    factor = torch.rand(6, 6, generator=generator)
    floor = (1e-4 * factor @ factor.T).flatten().tolist()
    views = [0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0, -0.4, 0.5, 0.25, 0.5, 0.5, 0.5, 0.5]
    return {
        "source": f"{name}.glb",
        "truth": truth or f"{name}.truth.npz",
        "truth_sha256": sha256 or "5e" * 32,
        "created": DATE,
        "images": 37,
        "train_s": 12.625,
        "psnr_db": 31.25,
        "psnr_one_exposure_db": 32.5,
        "noise_std": 0.0625,
        "noise_core_std": 0.03125,
        "outlier_share": 0.015625,
        "learned_from": "pictures and depth",
        "proven_from": "depth",
        "surface_taken_for_free": 0.0078125,
        "free_taken_for_free": 0.9375,
        "unproven_share": 0.21875,
        "seed": 11,
        "iterations": 1234,
        "baked_psnr_db": 40.5,
        "camera": _CAMERAS[name],
        "placed": [2.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.125, 0.25, 0.375],
        "views": views,
        "position_floor_m": 0.0125,
        "pose_floor": floor,
        "guesses": ["up is taken from the cameras", "a unit is taken for a metre"],
    }


def voxel_field(info: dict[str, Any], shape: tuple[int, int, int] = (12, 11, 10), seed: int = 5) -> p.VoxelField:
    """A field of random numbers, empty in one half, with surroundings and evidence."""
    generator = torch.Generator().manual_seed(seed)
    values = torch.rand(*shape, 4, generator=generator)
    values[..., 0] = values[..., 0] * 12 - 8
    values[: shape[0] // 2, ..., 0] = p.EMPTY_RAW
    around = torch.rand(8, 8, 8, 4, generator=generator)
    around[..., 0] = around[..., 0] * 6 - 5
    evidence = torch.randint(0, len(p.Occupancy), shape, generator=generator, dtype=torch.uint8)
    box = p.Box.of((-1.0, -0.75, -0.25), (1.25, 0.875, 1.5))
    return p.VoxelField(
        box, values, torch.tensor([0.25, 0.5, 0.75]), p.FieldInfo.of(info), p.Surroundings(around), evidence
    )


def neural_field(info: dict[str, Any]) -> Any:
    """Two small networks in a frame of their own, with no setting at its default."""
    network = p.MlpConfig(
        depth=3,
        width=8,
        skips=(1, 2),
        position=p.Encoding(3, False, False),
        direction=p.Encoding(2, False, False),
        view_widths=(6, 5),
        linear_first=True,
        feature_relu=True,
    )
    box = p.Box.of((-1.0, -0.75, -0.25), (1.25, 0.875, 1.5))
    blank = p.blank_field(box, torch.tensor([0.125, 0.5, 0.875]), network, torch.Generator().manual_seed(3))
    generator = torch.Generator().manual_seed(4)
    for part in (blank.coarse, blank.fine):
        for weights in part.parameters():
            weights.requires_grad_(False).add_(0.01 * torch.rand(weights.shape, generator=generator))
    config = p.NeuralConfig(
        unit=1.125, activation=p.Activation.SOFTPLUS, coarse_bins=48, fine_per_bin=5, least_weight=0.002
    )
    turn = torch.tensor([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    frame = p.Pose(turn, torch.tensor([0.25, -0.5, 0.125]))
    parts = {"box": box, "coarse": blank.coarse, "fine": blank.fine, "background": blank.background}
    return type(blank)(**parts, frame=frame, config=config, info=p.FieldInfo.of(info))


def room() -> p.VoxelField:
    """A room of 2 m x 2 m x 1 m to plan and fly in: a coloured floor, coloured walls, three columns, no ceiling.

    Its numbers are such that its file holds them without loss.
    """
    values = torch.full((41, 41, 21, 4), p.EMPTY_RAW)
    values[..., 1:] = 0.0
    solid = torch.zeros(41, 41, 21, dtype=torch.bool)
    solid[:, :, :2] = True
    solid[:2], solid[-2:], solid[:, :2], solid[:, -2:] = True, True, True, True
    for x, y in ((14, 14), (22, 26), (29, 16)):
        solid[x : x + 5, y : y + 5] = True
    values[..., 0][solid] = 1.0
    axes = (torch.linspace(0, extent, count) for extent, count in ((9, 41), (9, 41), (5, 21)))
    x, y, z = torch.meshgrid(*axes, indexing="ij")
    waves = (3 * x).sin() + y.cos(), (2 * y).sin() + z.sin(), (x + z).cos() + (2 * x).sin()
    waves = 0.5 + 0.2 * torch.stack(waves, -1)
    values[..., 1:] = (waves.clamp(0, 1) * 255).round() / 255
    return p.VoxelField(p.Box.of((-1, -1, 0), (1, 1, 1)), values, torch.tensor([0.5, 0.75, 1.0]))


def truth_scene() -> p.Scene:
    """A mesh with a texture, solid parts and a sheet, as a ground truth is kept beside a field."""
    box = trimesh.creation.box((0.5, 0.25, 0.75))
    sheet = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0.5]], [[0, 1, 2]], process=False)
    count = len(box.faces)
    generator = np.random.default_rng(2)
    image = generator.integers(0, 256, (4, 5, 3), dtype=np.uint8)
    of_face = np.array([index % 2 - 1 for index in range(count)], np.int32)
    uv = generator.random((count, 3, 2)).astype(np.float32)
    tint = generator.integers(0, 256, (count, 3, 3), dtype=np.uint8)
    return p.Scene(
        "voxel.glb",
        "A box and a sheet",
        box,
        (box, box.copy().apply_translation((1.0, 0.0, 0.0))),
        p.Box.of((-1.0, -0.75, -0.25), (1.25, 0.875, 1.5)),
        (0.25, 0.5, 0.75),
        (),
        0.03125,
        p.Paint((image,), of_face, uv, tint),
        (sheet,),
        p.Vantage.OUTSIDE,
    )


def flight_steps() -> tuple[p.NavigationStep, ...]:
    """A flight along a helix, with pictures, in which all that can be recovered from happens once."""
    happened = [None, None, *p.SupervisorAction, None, None, None]
    count = len(happened) - 1
    motion = helix(count)
    generator = torch.Generator().manual_seed(0)
    made = []
    for index, recovery in enumerate(happened):
        truth = motion.states[index].retract(0.01 * torch.randn(12, generator=generator))
        factor = 0.02 * torch.randn(12, 12, generator=generator)
        belief = p.Belief(truth.retract(0.02 * torch.randn(12, generator=generator)), factor @ factor.T)
        image = torch.full((12, 16, 3), 20 * index % 256, dtype=torch.uint8) if index else None
        rest = p.Motion(motion.states[index:], motion.actions[index:], motion.dt)
        made.append(p.NavigationStep(
            index, index * motion.dt, motion.actions[index - 1] if index else None, truth, belief, image, None, rest,
            index == 3, 12.5 + index, 3.25 + index, p.EpisodeOutcome.COLLIDED if index == count else None,
            recovery=recovery, late=index in (4, 9),
        ))  # fmt: skip
    return tuple(made)


def outcome_steps() -> tuple[p.NavigationStep, ...]:
    """Steps of which each ends a flight in another way."""
    motion = helix(len(p.EpisodeOutcome))
    return tuple(
        p.NavigationStep(
            index, index * motion.dt, motion.actions[index - 1] if index else None, motion.states[index],
            p.Belief(motion.states[index], torch.eye(12)), None, None,
            p.Motion(motion.states[index:], motion.actions[index:], motion.dt), False, 0.0, 0.0, outcome,
        )
        for index, outcome in enumerate(p.EpisodeOutcome)
    )  # fmt: skip


def helix(steps: int) -> p.Motion:
    """A motion along a climbing curve, at rest at both ends, rolling and yawing."""
    dt = 0.125
    share = torch.linspace(0, 1, steps + 1)
    turn, zero = 2 * share * share * (3 - 2 * share), torch.zeros(steps + 1)
    position = torch.stack([0.5 * turn.cos(), 0.5 * turn.sin(), 0.375 + 0.125 * turn], -1)
    velocity = torch.cat([position.diff(dim=0) / dt, torch.zeros(1, 3)])
    rotation = p.so3.from_yaw(0.5 + turn) @ p.so3.exp(torch.stack([0.1 * share * (1 - share), zero, zero], -1))
    rates = torch.stack([zero, zero, torch.cat([turn.diff() / dt, torch.zeros(1)])], -1)
    actions = torch.stack([2.5 + 0.25 * share, 0.01 * share, -0.02 * share, 0.03 * share], -1)[:-1]
    return p.Motion(p.RigidState(position, velocity, rotation, rates), actions, dt)


def metadata(**changes: Any) -> p.RunMetadata:
    """What is known of the flight, with no value at its default."""
    ends = p.Ends(p.End((0.5, 0.0, 0.375), 0.5), p.End((-0.25, 0.5, 0.625), 2.5))
    known: dict[str, Any] = {
        "place": "a room", "source": "room.npz", "robot": "quadrotor", "planner": "paper", "estimator": "fast",
        "seed": 7, "dt": 0.125, "ends": ends, "task": "around the columns", "open_loop": True, "unknown": "free",
        "date": DATE,
    }  # fmt: skip
    return p.RunMetadata(**known | changes)


SESSION: dict[str, Any] = {
    "moment": {
        "choice": {"robot": "couch", "planner": "paper", "estimator": "inerf"},
        "task": "Through the gap",
        "home": "Over the stones",
        "home_ends": {
            "start": {"position": [0.25, -0.5, 0.125], "yaw": 1.5},
            "goal": {"position": [-0.25, 0.5, 0.375], "yaw": -1.5},
        },
        "ends": {
            "start": {"position": [0.125, -0.25, 0.5], "yaw": 0.75},
            "goal": {"position": [-0.125, 0.25, 0.625], "yaw": -0.75},
        },
        "plan_settings": {
            "duration_s": 3.5,
            "shortest": True,
            "max_collision": 0.25,
            "unknown": "free",
            "weights": {
                "collision": 2.0, "control": 0.25, "limits": 50.0, "outside": 500.0, "risk": 10.0,
                "samples_per_step": 5, "margin": 0.02,
            },
        },
        "flight_settings": {
            "seed": 9, "position_noise_m": 0.03, "attitude_noise_rad": 0.04, "open_loop": True, "world": "physical",
            "realtime": True, "pace": 2.0,
        },
        "view_settings": {
            "backdrop": "splats", "opacity": 0.5, "clip": 0.75, "truth": True, "occupied": True, "unknown": True,
            "slice": 0.25, "camera": "behind the robot", "light": True, "clearance": True, "ellipsoid": 3.0,
        },
    },
    "view": [[1.0, 2.0, 3.0], [0.5, 0.25, 0.125]],
}  # fmt: skip
"""How a place was left, by the names in the file."""

ROBOTS = {
    "scout": """\
# A quadrotor for which everything is said.
name: scout
kind: quadrotor
mass: 0.75
inertia: [4.0e-3, 4.5e-3, 7.5e-3]
body: {box: [0.26, 0.24, 0.08], points: [6, 5, 3]}
limits: {thrust: 16.5, tilt: 0.9, speed: 2.5, body_rate: 7.5, angular_acceleration: 8.5}
camera: {position: [0.1, 0.02, -0.01], pitch: 0.2, width: 160, height: 120, fov: 80}
""",
    "cylinder": """\
name: cylinder
kind: diffdrive
body: {cylinder: {radius: 0.12, height: 0.1}, spacing: 0.04}
limits: {speed: 1.25, yaw_rate: 2.5, acceleration: 3.5, yaw_acceleration: 11.0}
camera: {position: [0.05, 0.0, 0.05], pitch: -0.1, file: lens.yaml}
""",
    "settee": """\
name: settee
kind: couch
mass: 25.0
body: {mesh: hull.stl, spacing: 0.1, hull: true}
limits: {speed: 1.25, yaw_rate: 2.25, force: 120.0}
""",
    "balls": """\
name: balls
kind: quadrotor
mass: 0.5
body: {spheres: [[0, 0, 0, 0.1]], spacing: 0.05}
limits: {}
""",
}
"""Robots' files by name."""
LENS = {
    "image_width": 160, "image_height": 120, "camera_name": "front", "distortion_model": "plumb_bob",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [100.5, 0.0, 80.25, 0.0, 100.25, 60.5, 0.0, 0.0, 1.0]},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.01, -0.02, 0.001, -0.002, 0.003]},
}  # fmt: skip
"""Calibration that a robot's file names, as ROS writes it."""


def lens_text() -> str:
    """The calibration as YAML, which JSON is."""
    return json.dumps(LENS, indent=2) + "\n"


def hull() -> bytes:
    """The mesh that a robot's file names: a wedge, as STL."""
    points = [[-0.4, -0.2, -0.1], [0.4, -0.2, -0.1], [0.4, 0.2, -0.1], [-0.4, 0.2, -0.1], [-0.4, 0, 0.2], [0.4, 0, 0.2]]
    return bytes(trimesh.convex.convex_hull(np.array(points)).export(file_type="stl"))


MESSAGES: list[dict[str, Any]] = [
    {
        "type": "picture", "time": 1.5, "data": "AAEC", "encoding": "rgb8", "size": {"width": 1, "height": 1},
        "now": 1.75, "goal": {"position": [0.5, 0.25, 0.125], "yaw": 0.75},
    },
    {
        "type": "welcome", "field": "room", "robot": "quadrotor", "camera": {"width": 200, "height": 100},
        "box": [[-1.0, -1.0, 0.0], [1.0, 1.0, 1.0]], "version": 1,
    },
    *(
        {
            "type": "answer",
            "answer": {
                "time": 1.5, "status": "followed", "sentence": "followed by the picture",
                "position": [0.5, 0.25, 0.125], "quaternion": [1.0, 0.0, 0.0, 0.0], "velocity": [0.125, 0.25, 0.5],
                "covariance": [[0.5 if row == column else 0.125 for column in range(6)] for row in range(6)],
                "guidance": {
                    "order": order, "reason": "the way is free",
                    "setpoints": [{
                        "time": 1.75, "position": [0.5, 0.25, 0.125], "velocity": [1.0, 2.0, 3.0],
                        "acceleration": [0.1, 0.2, 0.3], "yaw": 0.75,
                    }],
                    "collision_bound": 0.0625,
                },
                "track_ms": 12.5, "plan_ms": 3.25, "waited_ms": 0.5, "dropped": 2,
            },
        }
        for order in ("follow", "brake", "hold", "arrived")
    ),
    {"type": "error", "sentence": "this is no picture message"},
]  # fmt: skip
"""Messages between a vehicle and the server, by the names on the wire."""
