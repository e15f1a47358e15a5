"""Global localization: find a camera anywhere in the place by one picture, with no prior.

Two kinds of pictures, all from the mesh. Both are taken at random places of the box, 15 cm from anything at least,
heading anywhere, with pitch and roll of 0.2 rad standard deviation:

    sighted   the mesh fills a quarter of the picture at least, as in the photographs that bundled fields learned from
    any       any content, which in an open place is often sky alone: here a picture without information must
              never be taken for a place
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator import RelocaliseConfig, RelocaliseOutcome
from nerfnav.experiments.arena import Arena, make_renderer, make_searcher
from nerfnav.experiments.figures import COLORS, Figure, draw_distribution, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.geometry import Pose, so3
from nerfnav.robots import CAMERA
from nerfnav.world import CaptureConfig, capture_poses

KINDS = {"sighted": 0.25, "any": 0.0}
"""Least share of the picture that the mesh fills."""
RIGHT = {"position_m": 0.05, "rotation_deg": 5.0}
"""An answer is right within this."""
_TRIALS = 50
_CLEARANCE = 0.15  # of a camera from anything [m]
_FIRST_SEED = 9101  # of the poses, far from those of the photographs


@dataclass(frozen=True)
class LostCamera:
    """Trial of the experiment: one picture."""

    kind: str
    """Of KINDS."""
    index: int
    """Of the pose among those of its kind."""
    pose: Pose
    """True camera pose, T_world_camera."""


def run(study: Study) -> ExperimentSteps:
    """Search for every picture: `trials` sighted ones, and half as many of any kind."""
    count = study.trials or _TRIALS
    arena = study.open_arena()
    trials = [
        LostCamera(kind, index, poses[index])
        for kind, number in (("sighted", count), ("any", -(-count // 2)))
        for poses in [_poses(arena, kind, number, study.seed)]
        for index in range(number)
    ]
    rows = yield from run_trials(study, "searching", search, trials)
    return Results(summarize(rows), tuple(rows), {"relocalisation": partial(draw_figure, rows)}, ("kind",))


def search(arena: Arena, lost: LostCamera) -> Row:
    """Take the picture, search, and judge the answer."""
    picture = make_renderer(arena).render(CAMERA, lost.pose)
    searcher = make_searcher(arena)
    searcher.looks  # noqa: B018 - made once for all pictures, and not part of a search
    begun = time.perf_counter()
    result = run_steps(searcher.relocalise(picture.image))
    seconds = time.perf_counter() - begun
    last = result.step
    errors = {
        "position_m": (last.poses.position[0] - lost.pose.position).norm().item(),
        "rotation_deg": torch.rad2deg(so3.local(lost.pose.rotation, last.poses.rotation[0]).norm()).item(),
    }
    return {"kind": lost.kind, "index": lost.index} | errors | {
        "right": all(errors[name] <= bound for name, bound in RIGHT.items()),
        "outcome": result.outcome.name.lower(),
        "weight": last.weights[0].item(),
        "difference_stds": last.differences[0].item() / searcher.noise.std,
        "mesh_share": picture.depth.isfinite().float().mean().item(),
        "seconds": seconds,
    }  # fmt: skip


def _poses(arena: Arena, kind: str, count: int, seed: int) -> Pose:
    """Cameras T_world_camera, batch shape (count,)."""
    config = CaptureConfig(images=count, inside_share=1.0, clearance=_CLEARANCE, seen_share=KINDS[kind])
    return capture_poses(arena.scene, config, torch.Generator().manual_seed(_FIRST_SEED + seed))


def summarize(rows: Sequence[Row]) -> Row:
    """For each kind of picture: how often the answer is right, how often it claims to be, and how long it takes."""
    return {kind: _summary([row for row in rows if row["kind"] == kind]) for kind in KINDS}


def _summary(rows: Sequence[Row]) -> Row:
    found = RelocaliseOutcome.FOUND.name.lower()
    right = [row for row in rows if row["right"]]
    return {
        "trials": len(rows),
        "right_share": len(right) / max(1, len(rows)),
        "found_and_right": sum(row["outcome"] == found for row in right),
        "found_but_wrong": sum(row["outcome"] == found and not row["right"] for row in rows),
        "right_but_unsure": sum(row["outcome"] != found for row in right),
        "position_median_m": _median(rows, "position_m"),
        "rotation_median_deg": _median(rows, "rotation_deg"),
        "seconds_median": _median(rows, "seconds"),
        "saw_no_mesh": sum(row["mesh_share"] == 0 for row in rows),
    }


def draw_figure(rows: Sequence[Row]) -> Figure:
    """Plot the distribution of position errors, and the errors against the colour difference."""
    figure, (near, cloud) = panels(("Share of pictures that are as near", "Can the picture tell?"))
    for kind, color in zip(KINDS, COLORS, strict=False):
        mine = [row for row in rows if row["kind"] == kind]
        draw_distribution(near, [row["position_m"] for row in mine], color, kind)
        for found, marker in ((True, "o"), (False, "x")):
            some = [row for row in mine if (row["outcome"] == "found") == found]
            cloud.plot(
                [row["difference_stds"] for row in some], [row["position_m"] for row in some],
                marker, color=color, markersize=4, label=f"{kind}, {'found' if found else 'not sure'}",
            )  # fmt: skip
    near.set(xscale="log", xlabel="position error [m]", ylim=(0, 1))
    cloud.axvline(RelocaliseConfig().gate, color="grey", linewidth=0.8)
    cloud.set(yscale="log", xlabel="difference [standard deviations of colour]", ylabel="position error [m]")
    near.legend(frameon=False)
    cloud.legend(frameon=False, fontsize=7)
    return figure


def _median(rows: Sequence[Row], name: str) -> float | None:
    return float(np.median([row[name] for row in rows])) if rows else None
