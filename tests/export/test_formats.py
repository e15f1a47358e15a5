"""What may be exported in which format, and what only by force."""

import json
import math
from dataclasses import replace

import pytest

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError
from nerfnav.export.formats import FORMATS, explain_unsafe
from nerfnav.export.qgroundcontrol import qgroundcontrol
from nerfnav.export.recording import Recording
from nerfnav.navigation import EpisodeOutcome
from nerfnav.planner import PlanOutcome
from nerfnav.robots.quadrotor import Quadrotor
from tests.export.flights import curve, flight, hover_to_hover, plan

ZURICH = (47.3977, 8.5456, 488.0)
BAD = [outcome for outcome in PlanOutcome if outcome not in (PlanOutcome.CONVERGED, PlanOutcome.ITERATION_LIMIT)]


@pytest.mark.parametrize("outcome", BAD)
def test_a_plan_that_ended_badly_leaves_only_by_force_and_says_how_it_ended(outcome: PlanOutcome) -> None:
    recording = Recording.of_plan(curve(), Quadrotor(), "", outcome)
    with pytest.raises(InvalidInputError, match=r"this plan is not to be flown: .*--force"):
        FORMATS["csv"].exported(recording)
    name = outcome.name.lower()
    for form in ("px4", "ardupilot", "json", "tum", "mcap", "gltf"):
        assert name in FORMATS[form].exported(recording, force=True).content.decode(errors="ignore")


def test_no_vehicle_repeats_a_flight_that_hit_something_left_the_place_or_was_lost() -> None:
    ended_badly = {EpisodeOutcome.COLLIDED, EpisodeOutcome.OUTSIDE, EpisodeOutcome.DIVERGED}
    assert {outcome for outcome in EpisodeOutcome if explain_unsafe(outcome, FORMATS["px4"])} == ended_badly
    assert not any(explain_unsafe(outcome, FORMATS["csv"]) for outcome in EpisodeOutcome)


def test_a_flight_that_touched_something_is_reported_in_every_format_and_flown_again_by_force_alone() -> None:
    recording = replace(flight(), datum=ZURICH)
    for form in FORMATS.values():
        if form.moves_vehicle:
            with pytest.raises(InvalidInputError, match="not to be flown again: the robot touched"):
                form.exported(recording)
        assert form.exported(recording, force=True).content
        if form.name not in ("csv", "crazyflie", "rosbag2", "html"):  # tables of numbers; zipped; in words
            assert b"collided" in form.exported(recording, force=True).content


@pytest.mark.parametrize("name", [name for name, form in FORMATS.items() if form.moves_vehicle])
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
