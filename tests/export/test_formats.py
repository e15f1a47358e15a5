"""What may be exported in which format, and what only by force."""

import json
import math
from dataclasses import replace

import pytest
import torch

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.export.formats import FORMATS, explain_unsafe
from nerfnav.export.qgroundcontrol import qgroundcontrol
from nerfnav.export.recording import Recording, Subject
from nerfnav.export.refusal import ExportRefusedError, Remedy
from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry.box import Box
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.planner import PlanOutcome
from nerfnav.robots.quadrotor import Quadrotor, QuadrotorConfig
from nerfnav.robots.state import Motion, RigidState
from tests.export.flights import arrived, curve, flight, flown, hover_to_hover, plan

ZURICH = (47.3977, 8.5456, 488.0)
BAD = [outcome for outcome in PlanOutcome if outcome not in (PlanOutcome.CONVERGED, PlanOutcome.ITERATION_LIMIT)]


@pytest.mark.parametrize("outcome", BAD)
def test_a_plan_that_ended_badly_leaves_only_by_force_and_says_how_it_ended(outcome: PlanOutcome) -> None:
    recording = Recording.of_plan(curve(), Quadrotor(), "", outcome)
    with pytest.raises(InvalidInputError, match=r"the plan is not exported for csv: .*--force"):
        FORMATS["csv"].exported(recording)
    name = outcome.name.lower()
    for form in ("px4", "ardupilot", "json", "tum", "mcap", "gltf"):
        assert name in FORMATS[form].exported(recording, force=True).content.decode(errors="ignore")


def test_no_vehicle_repeats_a_flight_that_hit_something_left_the_place_or_was_lost() -> None:
    ended_badly = {
        EpisodeOutcome.COLLIDED, EpisodeOutcome.OUTSIDE, EpisodeOutcome.LOST, EpisodeOutcome.DIVERGED,
    }  # fmt: skip
    px4, csv = FORMATS["px4"], FORMATS["csv"]
    flown = Subject.EXECUTED
    assert {outcome for outcome in EpisodeOutcome if explain_unsafe(outcome, px4, flown)} == ended_badly
    assert not any(explain_unsafe(outcome, csv, flown) for outcome in EpisodeOutcome)


def test_a_flight_that_touched_something_is_reported_in_every_format_and_flown_again_by_force_alone() -> None:
    recording = replace(flight(), datum=ZURICH)
    for form in FORMATS.values():
        if form.moves_vehicle:
            with pytest.raises(ExportRefusedError) as refused:
                form.exported(recording, smooth=True)
            assert refused.value.refusal.why == EpisodeOutcome.COLLIDED.value
            assert refused.value.refusal.remedies == (Remedy.PLAN, Remedy.FORCE)
        held = recording if Subject.EXECUTED in form.subjects else flight(subject=Subject.ESTIMATE)
        content = form.exported(held, force=True, smooth=True).content
        if form.name not in ("csv", "crazyflie", "rosbag2", "html"):  # tables of numbers; zipped; in words
            assert b"collided" in content


MOVING = [name for name, form in FORMATS.items() if form.moves_vehicle]
ROOM = Box.of((-2, -2, -1), (3, 3, 3))
FREE = BallsField(ROOM, torch.tensor([[-1.5, -1.5, -0.5]]), torch.tensor([0.1]))
"""A field with nothing near the flights."""


def corner() -> Motion:
    """The plan around a corner, as a motion."""
    made = hover_to_hover()
    rotations = torch.eye(3).expand(len(made.times), 3, 3)
    position, velocity = made.position.float(), made.velocity.float()
    states = RigidState(position, velocity, rotations, torch.zeros_like(position))
    return Motion(states, torch.zeros(len(made.times) - 1, 4), float(made.times[1]))


def of(steps: tuple[NavigationStep, ...], subject: Subject) -> Recording:
    return replace(Recording.of_flight(steps, Quadrotor(), subject=subject), datum=ZURICH).with_field(FREE)


def test_vehicles_get_the_plan_by_default_estimators_the_estimate_and_all_others_the_executed_path() -> None:
    defaults = {name: form.choose_subject(flown=True) for name, form in FORMATS.items()}
    assert {name for name, subject in defaults.items() if subject is Subject.PLAN} == set(MOVING)
    assert {name for name, subject in defaults.items() if subject is Subject.ESTIMATE} == {
        "tum-estimate", "px4-odometry",
    }  # fmt: skip


@pytest.mark.parametrize("name", MOVING)
def test_after_a_flight_that_arrived_a_vehicle_gets_its_first_plan(name: str) -> None:
    form, motion = FORMATS[name], corner()
    made = form.exported(of(arrived(motion), form.choose_subject(flown=True)))
    assert made.info["motion"] == "the plan" and made.info["curve"]["outcome"] == "converged"
    assert made.content == form.exported(replace(Recording.of_plan(motion, Quadrotor()), datum=ZURICH)).content


@pytest.mark.parametrize("subject", [Subject.EXECUTED, Subject.ESTIMATE])
@pytest.mark.parametrize("name", MOVING)
def test_an_executed_path_and_an_estimate_move_a_vehicle_only_smoothed_and_judged(name: str, subject: Subject) -> None:
    form, recording = FORMATS[name], of(arrived(corner()), subject)
    for force in (False, True):
        with pytest.raises(ExportRefusedError) as refused:
            form.exported(recording, force=force)
        assert refused.value.refusal.subject is subject
        assert refused.value.refusal.remedies == (Remedy.PLAN, Remedy.SMOOTH)
    made = form.exported(recording, smooth=True)
    assert made.info["motion"].endswith("smoothed") and made.info["curve"]["outcome"] == "converged"
    middle = recording.position[len(recording.times) // 2].tolist()
    blocked = recording.with_field(BallsField(ROOM, torch.tensor([middle]), torch.tensor([0.1])))
    message = f"{subject.title} is not exported for {name}: its smooth curve cuts the corners.*--of plan.*--force"
    with pytest.raises(ExportRefusedError, match=message):
        form.exported(blocked, smooth=True)


def test_no_curve_near_an_executed_path_is_a_refusal_that_offers_the_plan() -> None:
    weak = replace(of(arrived(corner()), Subject.EXECUTED), robot=Quadrotor(QuadrotorConfig(max_thrust=2.0)))
    with pytest.raises(ExportRefusedError, match="limits are not kept") as refused:
        FORMATS["px4"].exported(weak, smooth=True)
    assert refused.value.refusal.remedies == (Remedy.PLAN,)


def test_a_flight_that_ended_badly_exports_its_plan_if_that_is_good() -> None:
    *steps, last = arrived(corner())
    bad = (*steps, replace(last, outcome=EpisodeOutcome.COLLIDED, touched=True))
    assert FORMATS["px4"].exported(of(bad, Subject.PLAN)).content
    with pytest.raises(ExportRefusedError):
        FORMATS["px4"].exported(of(bad, Subject.PLAN).with_outcome(PlanOutcome.TOUCHES_MESH))
    stuck = (replace(flown()[0], outcome=EpisodeOutcome.NO_PLAN),)
    with pytest.raises(ExportRefusedError) as refused:
        FORMATS["csv"].exported(of(stuck, Subject.PLAN))
    assert refused.value.refusal.why == PlanOutcome.NO_PATH.value


def test_a_flight_that_was_stored_without_a_first_plan_has_the_one_after_its_first_belief() -> None:
    recording = of(flown(), Subject.PLAN)
    torch.testing.assert_close(recording.position.float(), flown()[0].plan.states.position)


def test_each_subject_is_refused_where_it_does_not_exist_or_the_format_cannot_hold_it() -> None:
    with pytest.raises(InvalidInputError, match="not flown, so the executed path does not exist: fly it"):
        FORMATS["csv"].choose_subject(flown=False, of=Subject.EXECUTED)
    with pytest.raises(InvalidInputError, match="html holds the executed path alone: leave out --of"):
        FORMATS["html"].choose_subject(flown=True, of=Subject.PLAN)
    assert FORMATS["csv"].choose_subject(flown=False) is Subject.PLAN


def test_a_table_of_the_estimate_has_the_means_of_the_belief_and_their_deviations() -> None:
    recording = flight(subject=Subject.ESTIMATE)
    means = torch.stack([step.belief.mean.position for step in flown()])
    torch.testing.assert_close(recording.position.float(), means)
    content = json.loads(FORMATS["json"].exported(recording).content)
    assert content["subject"] == "estimate" and content["columns"][-3:] == ["sd_x", "sd_y", "sd_z"]


@pytest.mark.parametrize("name", MOVING)
def test_what_moves_drones_refuses_robots_on_the_ground(name: str) -> None:
    couch = replace(plan(), robot=robots.load("couch"), datum=ZURICH)
    with pytest.raises(InvalidInputError, match="for quadrotors, and couch does not fly"):
        FORMATS[name].exported(couch)


def test_a_mission_needs_to_know_where_on_earth_it_is() -> None:
    with pytest.raises(InvalidInputError, match="--datum LATITUDE LONGITUDE HEIGHT"):
        qgroundcontrol(hover_to_hover())
    for datum in ((91.0, 0.0, 0.0), (0.0, 200.0, 0.0), (math.nan, 0.0, 0.0)):
        with pytest.raises(InvalidInputError, match="a datum is a latitude"):
            qgroundcontrol(replace(hover_to_hover(), datum=datum))


def test_waypoints_are_as_far_apart_on_earth_as_in_the_world() -> None:
    recording = replace(hover_to_hover(), datum=ZURICH)
    mission = json.loads(qgroundcontrol(recording).content)["mission"]
    assert mission["plannedHomePosition"] == list(ZURICH)
    first, last = (mission["items"][index] for index in (0, -1))
    assert first["command"] == 16 and first["frame"] == 0 and first["AltitudeMode"] == 2
    a, b = (item["params"][4:] for item in (first, last))
    # a degree of latitude at 47.4 degrees is 111.18 km long, one of longitude 75.46 km (WGS 84)
    moved = recording.position[-1] - recording.position[0]
    assert (b[0] - a[0]) * 111_180 == pytest.approx(moved[1].item(), rel=2e-3)
    assert (b[1] - a[1]) * 75_460 == pytest.approx(moved[0].item(), rel=2e-3)
    assert b[2] - a[2] == pytest.approx(moved[2].item(), abs=1e-6)
    assert first["params"][3] == pytest.approx(90.0)  # the robot looks east at the start
    assert [item["doJumpId"] for item in mission["items"]] == list(range(1, len(mission["items"]) + 1))
