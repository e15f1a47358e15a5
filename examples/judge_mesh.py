"""Judge on a mesh: compute the overlap of a robot's body with your own mesh along a motion."""

import tempfile
from pathlib import Path

import torch
import trimesh
from trimesh.transformations import translation_matrix

import nerfnav
from nerfnav.importers import import_mesh

STEPS = 20


def write_mesh(path: Path) -> None:
    """A floor with a wall across it, in metres and Y-up as glTF has it; any tool can write yours."""
    floor = trimesh.creation.box((3.0, 0.1, 3.0), translation_matrix((0, -0.05, 0)))
    wall = trimesh.creation.box((0.1, 0.8, 3.0), translation_matrix((0, 0.4, 0)))
    trimesh.Scene([floor, wall]).export(path)


def flight(height: float) -> nerfnav.RigidState:
    """States along x from one side of the wall to the other, in an arc up to a height [m]."""
    share = torch.linspace(0, 1, STEPS + 1)
    rise = 0.3 + (height - 0.3) * torch.sin(torch.pi * share).clamp_min(0).sqrt()
    return nerfnav.RigidState.stack([
        nerfnav.RigidState.at_rest((2 * s - 1, 0.0, z)) for s, z in zip(share.tolist(), rise.tolist(), strict=True)
    ])  # fmt: skip


def main() -> None:
    """Judge a flight through the wall, and one over it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "wall.glb"
        write_mesh(path)
        imported = nerfnav.run_steps(import_mesh(path))
    scene, robot = imported.scene, nerfnav.Quadrotor()
    print(f"{len(scene.solids)} solids; guessed: {'; '.join(map(str, imported.report['guesses']))}")  # type: ignore
    for name, height in (("through", 0.3), ("over", 1.0)):
        report = nerfnav.judge(scene, robot.body, flight(height))
        step = report.first_touched_step
        where = "touches nothing" if step is None else f"touches first in step {step} of {STEPS}"
        print(f"{name} the wall: {where}; deepest overlap {1e6 * report.max_overlap_m3:.0f} cm^3")


if __name__ == "__main__":
    main()
