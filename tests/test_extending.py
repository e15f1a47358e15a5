"""One of each from outside the package: registered by its public function, and met where users meet such things."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
import viser
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import FieldFileError, InvalidInputError, NameTakenError, UnknownNameError
from nerfnav.export import formats
from nerfnav.export.formats import FORMATS, ExportFormat
from nerfnav.export.recording import Exported, Recording
from nerfnav.field.core.codec import Encoded, FieldCodec
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.protocol import RaySamples, uniform_samples
from nerfnav.field.storage import checkpoint
from nerfnav.field.storage.checkpoint import CODECS, load_field, save_field
from nerfnav.geometry.box import Box
from nerfnav.planner import planners, terms
from nerfnav.planner.baselines.waypoint_following import plan_along
from nerfnav.planner.planners import PLANNERS
from nerfnav.planner.planners.planner import FieldPlanner, PlannerEntry
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.astar import waypoints_along
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanSteps
from nerfnav.planner.terms.term import CostTerm, TermContext
from nerfnav.planner.trajectory import Route
from nerfnav.robots import ROBOTS, RobotEntry
from nerfnav.robots.body import Body
from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion, RigidState
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.events import JobFinished, PlaceOpened
from nerfnav_app.page import catalog as tabs
from nerfnav_app.page.kit.panel import Page, PanelEntry
from nerfnav_app.queries import catalog
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.server import App
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import ScriptedWork, balls_place
from tests.waiting import free_port, until

OVER = ["--start", "-0.8", "0.0", "0.4", "--goal", "0.8", "0.0", "0.4", "--steps", "12", "--dt", "0.2"]
"""A route over the ball in the middle of the place."""
ABOVE = ["0.62" if word == "0.4" else word for word in OVER]
"""The same, higher than all balls."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The field file of a place of three balls."""
    path = tmp_path_factory.mktemp("places") / "balls.npz"
    save_field(balls_place().field, path)
    return path


@pytest.fixture
def nerfnav(capsys: pytest.CaptureFixture[str]) -> Callable[..., dict[str, Any]]:
    """Runs a command line, which must succeed, and gives the numbers that it prints."""

    def run(*words: object) -> dict[str, Any]:
        code = main([*map(str, words), "--json"])
        out, err = capsys.readouterr()
        assert code == 0, err
        return json.loads(out.splitlines()[-1])

    return run


def positions(folder: Path) -> np.ndarray:
    """What a plan wrote (times, 3) [m]."""
    rows = np.genfromtxt(folder / "trajectory.csv", delimiter=",", names=True)
    return np.stack([rows[f"{axis}_m"] for axis in "xyz"], -1)


# A planner ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DetourConfig:
    """How the detour planner plans."""

    side: float = 0.7
    """How far beside the straight line it goes [m]."""
    weights: CostWeights = field(default_factory=CostWeights)
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    iterations: int = 1


@dataclass(frozen=True)
class DetourPlanner(FieldPlanner):
    """Over one point beside the straight line, whatever stands there."""

    first: DetourConfig = field(default_factory=DetourConfig)
    again: DetourConfig = field(default_factory=DetourConfig)
    occupancy: OccupancyMap | None = None

    def plan(self, route: Route) -> PlanSteps:
        """See Planner."""
        start, goal = route.start.position, route.goal.position
        beside = (start + goal) / 2 + torch.tensor([0.0, self.first.side, 0.0])
        waypoints = waypoints_along(torch.stack([start, beside, goal]), route.start, route.goal, route.steps)
        yield from ()
        return plan_along(self.problem(route), waypoints, self.first.weights, PlanOutcome.CONVERGED)

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """See Planner."""
        return self.plan(route)


@pytest.fixture
def detour() -> Iterator[None]:
    planners.register(PlannerEntry("detour", DetourPlanner, DetourConfig))
    yield
    PLANNERS.unregister("detour")


@pytest.mark.usefixtures("detour")
def test_a_planner_plans_by_its_name_with_settings_of_its_own(
    place: Path, nerfnav: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    sides = {}
    for side in (0.6, -0.4):
        folder = tmp_path / str(side)
        plan = nerfnav("plan", place, *ABOVE, "--planner", "detour", "--side", side, "--out", folder)
        assert (plan["outcome"], plan["iterations"]) == ("converged", 1)
        sides[side] = positions(folder)[:, 1]
    assert 0.35 < sides[0.6].max() < 0.7 and sides[0.6].min() > -0.05, "past the point, its corner rounded"
    assert -0.5 < sides[-0.4].min() < -0.2 and sides[-0.4].max() < 0.05, "on the other side"


def test_a_planner_that_is_taken_out_again_is_unknown(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", str(place), *OVER, "--planner", "detour"]) == 2
    assert "no planner named 'detour'; known are: fast" in capsys.readouterr().err


# A cost term ----------------------------------------------------------------------------------------------------------


def height(_: TermContext, motion: Motion) -> Tensor:
    """sum_t z_t^2 [m^2]."""
    return motion.states.position[..., 2].square().sum(-1)


@pytest.fixture
def low() -> Iterator[None]:
    terms.register(CostTerm("height", height, 20.0))
    yield
    terms.unregister("height")


def test_a_cost_term_without_kernel_counts_in_the_fast_planner_and_says_what_it_costs(
    place: Path, nerfnav: Callable[..., dict[str, Any]], tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    free = nerfnav("plan", place, *OVER, "--planner", "fast", "--out", tmp_path / "free")
    request.getfixturevalue("low")
    kept = nerfnav("plan", place, *OVER, "--planner", "fast", "--out", tmp_path / "low")
    assert "added" not in free["cost"] and kept["outcome"] == "converged"
    told = kept["cost"]["added"]["height"]
    assert 0 < told["ms"] < 1000
    high, low = (np.square(positions(tmp_path / name)[:, 2]).sum() for name in ("free", "low"))
    assert low < 0.97 * high, "the plan keeps lower for it"
    assert told["value"] == pytest.approx(20 * low, rel=1e-3)


# A robot --------------------------------------------------------------------------------------------------------------


class Crane(Robot):
    """A level hook that is told velocities [m/s]: p' = p + v dt, v' = u; flat in its position."""

    name, minimum_steps = "crane", 3
    action_names, action_weights = ("vx_mps", "vy_mps", "vz_mps"), (0.1, 0.1, 0.1)
    body = Body.box((0.06, 0.06, 0.2), (3, 3, 5))

    def step(self, state: RigidState, action: Tensor, dt: float) -> RigidState:
        """Move with the velocity of the state, then take that of the action."""
        return RigidState(state.position + state.velocity * dt, action, state.rotation, state.body_rate)

    def hold(self, state: RigidState, dt: float, turn: float = 0.0) -> Tensor:
        """Stop."""
        return torch.zeros(3)

    def motion(self, free: Tensor, start: RigidState, goal: RigidState, steps: int, dt: float) -> Motion:
        """Positions whose differences are velocities, and actions the velocities of the next time."""
        ends = start.position, start.position + dt * start.velocity, goal.position, goal.velocity
        first, second, last, arriving = (end.expand(*free.shape[:-1], 1, 3) for end in ends)
        path = torch.cat([first, second, free.unflatten(-1, (steps - 2, 3)), last], -2)
        velocity = torch.cat([path.diff(dim=-2) / dt, arriving], -2)
        level = start.rotation.expand(*path.shape, 3)
        return Motion(RigidState(path, velocity, level, torch.zeros_like(path)), velocity[..., 1:, :], dt)

    def encode(self, waypoints: Tensor, start: RigidState, goal: RigidState, dt: float) -> Tensor:
        """The positions that are free, as they are."""
        return waypoints[2:-1, :3].flatten()

    def free_scales(self, free: Tensor) -> Tensor:
        """A body's height."""
        return torch.full_like(free, 0.2)


@pytest.fixture
def crane() -> Iterator[None]:
    robots.register(RobotEntry("crane", Crane))
    yield
    ROBOTS.unregister("crane")


@pytest.mark.usefixtures("crane")
def test_a_robot_is_planned_for_by_its_name(
    place: Path, nerfnav: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    plan = nerfnav("plan", place, *OVER, "--robot", "crane", "--out", tmp_path)
    assert plan["outcome"] == "converged" and plan["safety"]["min_clearance_m"] > 0
    written = json.loads((tmp_path / "trajectory.json").read_text())
    assert written["robot"] == "crane" and "vx_mps" in str(written["columns"])
    path, far = positions(tmp_path), np.linalg.norm(positions(tmp_path) - [0, 0, 0.3], axis=-1).min()
    assert np.allclose(path[[0, -1]], [[-0.8, 0, 0.4], [0.8, 0, 0.4]], atol=1e-5) and far > 0.2


# A field --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class PillarField:
    """A soft vertical pillar in the middle of a box, darker than the white behind it."""

    box: Box
    radius: float
    """[m]."""
    info: FieldInfo = field(default_factory=FieldInfo)
    step: float = 0.04

    @property
    def background(self) -> Tensor:
        """White."""
        return torch.ones(3)

    @property
    def resolution(self) -> float:
        """Distance of samples [m]."""
        return self.step

    def density(self, points: Tensor) -> Tensor:
        """rho [1/m]."""
        across = (points - self.box.center.to(points))[..., :2]
        distance = (across.square().sum(-1) + 1e-12).sqrt()
        soft = torch.sigmoid((self.radius - distance) / 0.01)
        return torch.where(self.box.contains(points), 200 * soft, torch.zeros_like(soft))

    def radiance(self, points: Tensor, directions: Tensor) -> Tensor:
        """Red."""
        return torch.tensor([0.8, 0.1, 0.1]).to(points).expand_as(points)

    def samples(self, origins: Tensor, directions: Tensor) -> RaySamples:
        """Evenly."""
        return uniform_samples(self.box, origins, directions, self.step)


def encode(pillar: PillarField) -> Encoded:
    """Its radius in the header, its box as an array."""
    box = torch.stack([pillar.box.lower, pillar.box.upper]).numpy()
    return Encoded({"radius": pillar.radius, "info": asdict(pillar.info)}, {"box": box})


def decode(header: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> PillarField:
    """See `encode`."""
    lower, upper = torch.from_numpy(arrays["box"])
    return PillarField(Box(lower, upper), float(header["radius"]), FieldInfo.of(header["info"]))


PILLAR = PillarField(Box.of((-1, -1, 0), (1, 1, 0.8)), 0.25, FieldInfo(source="a formula"))
CODEC = FieldCodec("pillar", 1, PillarField, encode, decode)


@pytest.fixture
def pillar(tmp_path: Path) -> Iterator[Path]:
    """A file of the field, whose codec is known."""
    checkpoint.register(CODEC)
    save_field(PILLAR, tmp_path / "pillar.npz")
    yield tmp_path / "pillar.npz"
    CODECS.unregister("pillar")


def test_a_field_is_saved_and_loaded_by_its_codec(pillar: Path) -> None:
    loaded, points = load_field(pillar), torch.rand(50, 3)
    assert isinstance(loaded, PillarField) and loaded.info == PILLAR.info
    assert torch.equal(loaded.density(points), PILLAR.density(points))


def test_a_field_is_planned_in_and_seen_from_the_command_line(
    pillar: Path, nerfnav: Callable[..., dict[str, Any]], tmp_path: Path
) -> None:
    plan = nerfnav("plan", pillar, *OVER, "--out", tmp_path / "plan")
    assert plan["outcome"] == "converged" and plan["safety"]["min_clearance_m"] > 0
    assert np.linalg.norm(positions(tmp_path / "plan")[:, :2], axis=-1).min() > PILLAR.radius
    told = nerfnav("info", pillar, "--png", tmp_path / "pillar.png")
    assert (told["source"], told["voxel_m"]) == ("a formula", 0.04)
    seen = cv2.imread(str(tmp_path / "pillar.png"))
    assert seen is not None
    blue, red = seen[..., 0], seen[..., 2]
    assert ((red > 150) & (blue < 60)).mean() > 0.02 and (blue > 250).mean() > 0.3, "a red pillar before white"


def test_a_broken_file_of_a_field_is_refused_in_one_sentence_and_so_is_one_without_codec(pillar: Path) -> None:
    with np.load(pillar) as whole:
        np.savez(pillar.with_name("broken.npz"), header=whole["header"])
        newer = json.dumps({**json.loads(str(whole["header"])), "version": 2})
        np.savez(pillar.with_name("newer.npz"), header=np.array(newer), box=whole["box"])
    with pytest.raises(FieldFileError, match="is not a whole nerfnav field"):
        load_field(pillar.with_name("broken.npz"))
    with pytest.raises(FieldFileError, match="written by a newer nerfnav"):
        load_field(pillar.with_name("newer.npz"))
    CODECS.unregister("pillar")
    try:
        with pytest.raises(FieldFileError, match=r"pillar\.npz is not a nerfnav field"):
            load_field(pillar)
        with pytest.raises(InvalidInputError, match="a PillarField cannot be kept in a file: bake it"):
            save_field(PILLAR, pillar)
    finally:
        checkpoint.register(CODEC)


# An exporter ----------------------------------------------------------------------------------------------------------


def points_text(made: Recording) -> Exported:
    """One line for each time."""
    lines = [" ".join(f"{value:.3f}" for value in row) for row in made.position.tolist()]
    return Exported("\n".join(lines).encode(), {"lines": len(lines)})


@pytest.fixture
def exporter() -> Iterator[None]:
    formats.register(ExportFormat("points", "txt", "points for people", points_text))
    yield
    FORMATS.unregister("points")


@pytest.mark.usefixtures("exporter")
def test_an_exporter_writes_by_its_name_and_is_listed_in_the_help(
    place: Path, nerfnav: Callable[..., dict[str, Any]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    nerfnav("plan", place, *OVER, "--out", tmp_path / "plan")
    told = nerfnav("export", tmp_path / "plan", "--format", "points", "--out", tmp_path / "points.txt")
    assert (told["format"], told["lines"]) == ("points", 13)
    assert (tmp_path / "points.txt").read_text().startswith("-0.800 0.000 0.400\n")
    assert main(["export", "--help"]) == 0
    assert "points executed points for people" in " ".join(capsys.readouterr().out.split())


# A query and a panel --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class DensestQuery(Query[float]):
    """How dense is the field at most, on a grid of so many points along each edge [1/m]?"""

    points: int

    @classmethod
    def pending(cls, session: Session) -> Iterator["DensestQuery"]:
        """Once for each place."""
        if not (query := cls(12)).is_answered(session):
            yield query

    def answer(self, resources: Resources) -> float:
        """Ask the field."""
        box, shares = resources.place.field.box, torch.linspace(0, 1, self.points)
        return resources.place.field.density(box.lower + torch.cartesian_prod(*[shares] * 3) * box.size).max().item()


class DensestPanel:
    """Shows the answer."""

    def __init__(self, page: Page) -> None:
        """Put up a line of text."""
        self.page = page
        self.line = page.server.gui.add_text("Densest", "", disabled=True)

    def show(self, session: Session) -> None:
        """Show the answer, or what is open while there is none."""
        found = DensestQuery.result_in(session)
        name = session.place.name if session.place is not None else ""
        self.line.value = name if found is None else f"{name}: {found:.0f} 1/m"


@pytest.fixture
def made() -> Iterator[list[DensestPanel]]:
    """The panels that pages have made."""
    made: list[DensestPanel] = []

    def make(page: Page) -> DensestPanel:
        made.append(DensestPanel(page))
        return made[-1]

    tabs.register(PanelEntry("densest", make, "Extra", viser.Icon.DROPLET))
    yield made
    tabs.PANELS.unregister("densest")


@pytest.fixture
def asked() -> Iterator[None]:
    catalog.register(DensestQuery)
    yield
    catalog.unregister(DensestQuery)


@pytest.fixture
def app_for() -> Iterator[Callable[..., App]]:
    """Starts apps, and ends them."""
    started: list[App] = []

    def start(work: Any) -> App:
        app = App("balls", port=free_port(), work=work)
        started.append(app)
        app.start()
        return app

    yield start
    for app in started:
        app.stop()


def opening(*_: object) -> Iterator[Any]:
    """The job that opens a place which needs no file."""
    yield from (PlaceOpened(balls_place()), JobFinished("open"))


def test_a_panel_is_on_the_page_in_a_tab_of_its_own(made: list[DensestPanel], app_for: Callable[..., App]) -> None:
    app_for(ScriptedWork())
    (panel,) = made
    gui = panel.page.server.gui
    assert panel.line in gui._gui_input_handle_from_uuid.values()
    tab = gui._container_handle_from_uuid[panel.line._impl.parent_container_id]
    assert isinstance(tab, viser.GuiTabHandle) and tab.icon == viser.Icon.DROPLET
    assert tab._parent._tab_labels == ("Scene", "Plan", "Fly", "Estimate", "Runs", "Experiments", "Export", "Extra")
    until(lambda: panel.line.value == "balls", "the panel was not shown the place")


@pytest.mark.usefixtures("asked")
def test_a_query_is_answered_by_the_worker_and_its_result_shown(
    made: list[DensestPanel], app_for: Callable[..., App]
) -> None:
    app = app_for(NavigationBackend(open=opening, runs=None))
    until(lambda: DensestQuery.result_in(app.session) is not None, "the query was not answered")
    densest = DensestQuery(12).answer(Resources(balls_place()))
    assert DensestQuery.result_in(app.session) == pytest.approx(densest) and densest > 50
    until(lambda: made[0].line.value == f"balls: {densest:.0f} 1/m", "the panel was not shown the answer")


# All of them ----------------------------------------------------------------------------------------------------------


def test_a_name_that_is_taken_is_refused_wherever_it_is_registered() -> None:
    taken: list[tuple[Callable[[Any], None], Any]] = [
        (planners.register, PlannerEntry("fast", DetourPlanner, DetourConfig)),
        (terms.register, CostTerm("control", height)),
        (robots.register, RobotEntry("couch", Crane)),
        (checkpoint.register, FieldCodec("nerfnav-voxel-field", 1, PillarField, encode, decode)),
        (formats.register, ExportFormat("csv", "csv", "another table", points_text)),
        (tabs.register, PanelEntry("status", DensestPanel)),
    ]
    for register, entry in taken:
        with pytest.raises(NameTakenError, match=f"named '{entry.name}' already: give yours another name"):
            register(entry)
    known = "no query named 'DensestQuery'; known are: BetterFieldQuery, ClearanceQuery"
    with pytest.raises(UnknownNameError, match=known):
        catalog.unregister(DensestQuery)
