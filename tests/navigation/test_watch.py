"""Change detection: what stands before a field is a region, and what the field shows from nearby is none."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator.core.belief import Belief
from nerfnav.field import FieldInfo, render_image
from nerfnav.geometry import FORWARD_MOUNT
from nerfnav.navigation.flight import NavigationStack
from nerfnav.navigation.seen_movers import SeenMovers
from nerfnav.navigation.watch import Watch
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle, Overlay, Sphere
from nerfnav.planner import Movers, planners
from nerfnav.planner.planners.fast import FastPlanner
from nerfnav.robots import CAMERA, RigidState, StateNoise
from tests.experiments.places import column
from tests.navigation.doubles import ROBOT, Oracle, StraightPlanner, simulator

FIELD = column().field
HERE = RigidState.at_rest((-0.8, 0.1, 0.5))
NOISE = StateNoise(0.005, 0.005, 0.005, 0.005)
BOX = Obstacle("box", BoxShape((0.1, 0.1, 0.1)), (-0.4, 0.2, 0.6))
WATCH = Watch(FIELD, CAMERA, noise_std=0.03)


def picture(state: RigidState, *obstacles: Obstacle) -> Tensor:
    """The field from a state, with obstacles before it."""
    pose = state.pose.compose(FORWARD_MOUNT)
    seen = render_image(FIELD, CAMERA, pose)
    if not obstacles:
        return seen.image
    depth = torch.where(seen.opacity > 0.5, seen.depth, torch.inf)
    return Overlay(obstacles).draw(seen.image, depth, CAMERA, pose, 0.0)


def believed(*, meters: float = 0.0, radians: float = 0.0) -> Belief:
    """A belief that is off by so much in each coordinate."""
    tangent = torch.tensor([meters] * 3 + [0.0] * 3 + [radians] * 3 + [0.0] * 3)
    return Belief(HERE.retract(tangent), NOISE.covariance())


@pytest.mark.parametrize(("meters", "radians"), [(0.0, 0.0), (0.005, -0.005), (-0.005, 0.005)])
def test_a_box_before_the_field_is_a_region_and_the_field_is_none(meters: float, radians: float) -> None:
    expected = WATCH.expect(believed(meters=meters, radians=radians))
    assert expected.hidden(picture(HERE)) is None
    assert expected.regions(picture(HERE), expected.belief, 0.0)[0] == ()
    image = picture(HERE, BOX)
    (region,), _ = expected.regions(image, Belief(HERE, NOISE.covariance()), 0.3)
    away = np.array(BOX.position) - HERE.position.double().numpy()
    distance = float(np.linalg.norm(away))
    assert region.time == 0.3 and region.direction @ away > 0.99 * distance
    assert 0.1 <= distance * region.size < 0.25, "it is as large as it looks, or a little larger"
    assert region.depth > distance and not region.is_cut
    hidden = expected.hidden(image)
    assert hidden is not None
    covered = Overlay((BOX,)).covered(CAMERA, HERE.pose.compose(FORWARD_MOUNT), 0.0, 0.0)
    assert hidden[covered].float().mean() > 0.9 and hidden.float().mean() < 0.3
    assert expected.hidden(image, hidden) is None, "what is known is not compared"
    assert expected.regions(image, expected.belief, 0.3, hidden)[0] == ()


def test_a_belief_that_is_not_sure_enough_explains_what_it_cannot_compare() -> None:
    unsure = Belief(HERE, StateNoise(0.3, 0.3, 0.3, 0.3).covariance())
    assert WATCH.expect(unsure).regions(picture(HERE, BOX), unsure, 0.0)[0] == ()


def test_a_picture_that_differs_nearly_everywhere_is_a_wrong_pose_and_no_mover() -> None:
    near = Obstacle("box", BoxShape((0.1, 1.0, 1.0)), (-0.6, 0.1, 0.5))
    belief = believed()
    assert WATCH.expect(belief).regions(picture(HERE, near), belief, 0.0)[0] == ()


def test_a_box_that_the_border_cuts_is_taken_to_be_as_wide_as_high() -> None:
    tall = Obstacle("box", BoxShape((0.1, 0.4, 0.3)), (-0.5, 0.5, 0.5))
    belief = believed()
    (region,), _ = WATCH.expect(belief).regions(picture(HERE, tall), belief, 0.0)
    assert region.width == pytest.approx(region.height, rel=0.02)


def test_the_field_is_seen_through_where_nothing_stands() -> None:
    belief = believed()
    expected = WATCH.expect(belief)
    _, free = expected.regions(picture(HERE), belief, 0.0)
    _, blocked = expected.regions(picture(HERE, BOX), belief, 0.0)
    places = np.array([BOX.position, (-1.5, 0.1, 0.5), (0.3, 0.1, 0.5)])
    assert free.clears(places).tolist() == [True, False, False], "behind the camera and in the column nothing is clear"
    assert blocked.clears(places).tolist() == [False, False, False]


def test_a_robot_that_watches_has_a_planner_that_knows_movers() -> None:
    estimator = Oracle(simulator())
    with pytest.raises(InvalidInputError, match="--watch"):
        NavigationStack(StraightPlanner(), estimator, watch=WATCH)
    seen = SeenMovers(least=0.1).after(
        WATCH.expect(believed()).regions(picture(HERE, BOX), believed(), 0.0)[0], None, 0.0
    )
    planner = planners.load("fast").planner(FIELD, ROBOT)
    known = Movers((Obstacle("ball", Sphere(0.1), (0, 0, 0), motion=ConstantVelocity((0.1, 0, 0))),))
    stack = NavigationStack(replace(planner, movers=known), estimator, watch=WATCH)
    assert stack.among(None) is stack is stack.among(SeenMovers())
    among = stack.among(seen).planner
    assert isinstance(among, FastPlanner) and among.movers is not None and seen.movers is not None
    assert len(among.movers.obstacles) == len(seen.movers.obstacles) + 1, "announced ones stay"


@pytest.mark.parametrize(("noise_std", "known"), [(None, 0.05), (0.044, 0.044), (0.088, None)])
def test_a_robot_watches_in_no_field_whose_colours_are_far_off(noise_std: float | None, known: float | None) -> None:
    field = replace(column().field, info=FieldInfo(noise_std=noise_std))
    if known is not None:
        assert Watch.of(field, ROBOT).noise_std == known
        return
    with pytest.raises(InvalidInputError, match=r"off by 0.088, and a robot that watches .* train it longer"):
        Watch.of(field, ROBOT)
