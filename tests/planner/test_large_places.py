"""Places of all sizes: maps that leave out nothing, in memory and time that a laptop has."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.occupancy import EMPTY_RAW, Occupancy, UnknownSpace, planning_field
from nerfnav.field.models.bricks import BrickField, convert_to_bricks
from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.planner.space.astar import SearchConfig, find_paths
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap, body_density
from nerfnav.robots.body import Body
from nerfnav.robots.state import RigidState
from tests.planner.halls import Block, Building, field_of, house, shell_of

ROBOT = robots.load("quadrotor25")
ROOT = Path(__file__).parents[2]


def cluttered(voxel: float, state: Occupancy) -> BrickField:
    """A room with thin things in it, most of them one node thick."""
    sticks = [Block((0.31 + 0.57 * n, 0.2, 0.2), (0.31 + 0.57 * n, 2.7, 0.2), state) for n in range(5)]
    specks = [Block((0.6 + 0.57 * n, 1.13, 1.31), (0.6 + 0.57 * n, 1.13, 1.31), state) for n in range(5)]
    return field_of(Building((3.0, 3.0, 2.0), (*shell_of((3.0, 3.0, 2.0), voxel), *sticks, *specks)), voxel)


@pytest.mark.parametrize("state", [Occupancy.SOLID, Occupancy.UNPROVEN])
@pytest.mark.parametrize("voxel", [0.05, 0.09, 0.21])
def test_nothing_solid_or_unproven_becomes_free_on_a_map_however_coarse(voxel: float, state: Occupancy):
    field = planning_field(cluttered(0.04, state), UnknownSpace.OCCUPIED)
    body = Body.box((0.25, 0.25, 0.1), (11, 11, 5))
    occupancy = OccupancyMap.of(field, body, OccupancyConfig(voxel=voxel))
    free = occupancy.centers((~occupancy.occupied).nonzero())
    for center in free[:: max(1, len(free) // 300)]:
        assert body_density(field, body, RigidState.at_rest(tuple(center.tolist()))) <= occupancy.scales.threshold
    assert 0.1 < (~occupancy.occupied).float().mean() < 0.9


@pytest.mark.parametrize("name", ["couch", "sofa"])
def test_nothing_solid_becomes_free_on_a_map_by_heading(name: str):
    field, robot = planning_field(field_of(house(), 0.08), UnknownSpace.OCCUPIED), robots.load(name)
    height = 0.3 + 0.5 * robot.body.extents[2]
    occupancy = OccupancyMap.of(field, robot.body, height=height)
    free = (~occupancy.by_heading).nonzero()
    for heading, *index in free[:: max(1, len(free) // 200)].tolist():
        yaw = heading * torch.pi / len(occupancy.by_heading)
        state = replace(
            RigidState.at_rest(tuple(occupancy.centers(torch.tensor([index]))[0].tolist())),
            rotation=so3.from_yaw(torch.tensor(yaw)),
        )
        assert body_density(field, robot.body, state) <= occupancy.scales.threshold
    assert len(free)


def test_a_map_of_bricks_is_that_of_the_dense_field():
    values = torch.full((61, 51, 23, 4), EMPTY_RAW)
    values[torch.rand(61, 51, 23, generator=torch.Generator().manual_seed(0)) < 1e-2] = 0.5
    dense = VoxelField(Box.of((0, 0, 0), (9, 7.5, 3.3)), values, torch.ones(3))
    maps = [OccupancyMap.of(field, ROBOT.body).by_heading for field in (convert_to_bricks(dense), dense)]
    assert 0.02 < maps[1].float().mean() < 0.95
    assert torch.equal(*maps)


@pytest.mark.parametrize("factor", [0.02, 1.0, 10.0])
def test_a_way_is_found_through_the_doors_of_a_house_of_any_size(factor: float):
    field = planning_field(field_of(house().scaled(factor), 0.06 * factor), UnknownSpace.OCCUPIED)
    body = Body.box(tuple(factor * edge for edge in ROBOT.body.extents), (6, 6, 3))  # type: ignore[arg-type]
    occupancy = OccupancyMap.of(field, body)
    start, goal = (RigidState.at_rest(tuple(factor * x for x in end)) for end in ((2.0, 3, 1.2), (17.0, 8, 1.2)))
    ways = find_paths(occupancy, start, goal, SearchConfig.single())
    assert len(ways) == 1
    assert ways[0].diff(dim=0).norm(dim=-1).sum() < 22 * factor
    assert occupancy.by_heading.numel() < 3_000_000


def test_a_map_that_memory_cannot_hold_is_refused_before_it_is_made(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10**6)
    with pytest.raises(InvalidInputError, match=r"a map of 19 x 11 x 3 m .* memory are free: choose a larger voxel"):
        OccupancyMap.of(field_of(house(), 0.1), ROBOT.body)


_HALL = """
import json, resource, sys, time
from pathlib import Path
import nerfnav
from nerfnav import robots
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.robots.state import RigidState
field = load_field(Path(sys.argv[1]))
ends = RigidState.at_rest((2.0, 2.0, 1.5)), RigidState.at_rest((38.0, 28.0, 6.0))
times = []
for _ in range(2):
    begun = time.process_time()
    step = nerfnav.plan(PlanProblem(field, robots.load("quadrotor25"), *ends), duration="auto")
    times.append(time.process_time() - begun)
peak = 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps({"outcome": step.outcome.name, "peak": peak, "seconds": times, "steps": step.trajectory.steps}))
"""


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss has another unit elsewhere")
def test_a_hall_of_forty_metres_at_four_centimetres_fits_in_four_gigabytes(tmp_path: Path):
    made = subprocess.run(
        [sys.executable, "-c", f"""
from pathlib import Path
from nerfnav.field.storage.checkpoint import save_field
from tests.planner.halls import field_of, hall
save_field(field_of(hall(), 0.04), Path({str(tmp_path / "hall.npz")!r}))
"""],
        cwd=ROOT, capture_output=True, text=True,
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    done = subprocess.run(
        [sys.executable, "-c", _HALL, str(tmp_path / "hall.npz")], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["outcome"] == "CONVERGED"
    assert found["peak"] < 4e9
