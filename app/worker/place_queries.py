"""Answers about a place: where a robot fits, where a click lands, what the field looks like from anywhere."""

import math

import numpy as np
import torch
import viser.transforms as tf

from app.jobs.fly import CAMERA
from app.places.ends import End
from app.places.place import Place, occupancy_of, planning_place
from app.state.queries import (
    EndQuestion,
    EndReport,
    EyeQuestion,
    EyeView,
    Landed,
    PointQuestion,
    Profile,
    ProfileQuestion,
    SliceQuestion,
    SliceView,
    Space,
    SpaceQuestion,
    SpaceView,
    View,
    ViewQuestion,
)
from nerfnav.field.render import render_image, render_rays
from nerfnav.field.unknown import Unknown
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry import so3
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.planner.costs import collision_per_step
from nerfnav.planner.ends import fits, nearest_free_pose
from nerfnav.planner.occupancy import OccupancyConfig
from nerfnav.planner.safety import SafetyConfig, clearance_of
from nerfnav.robots.state import Motion, RigidState

_LEAST_OPACITY = 0.5  # of a ray that has met something
_FAR = 150.0  # [m] where there is nothing: as far as the page can tell
_SLICE_CELLS = 240
_SLICE_DENSITY = 20.0  # [1/m] at which a slice is at its strongest
_FROM_CV = torch.diag(torch.tensor([1.0, -1.0, -1.0]))  # the page's cameras look along +z, ours along -z


def end_report(place: Place, question: EndQuestion) -> EndReport:
    """Whether the robot can be at an end, and the nearest one at which it can."""
    place = planning_place(place, Unknown.OCCUPIED)  # as plans see it
    body, state, name = place.robot.body, question.end.state(), question.which.value
    occupancy = occupancy_of(place, OccupancyConfig())
    if fits(place.field, body, state, occupancy.config.threshold):
        return EndReport(question, None)
    nearest = nearest_free_pose(place.field, body, state, occupancy)
    if nearest is None:
        return EndReport(question, f"the {name} is in occupied space, far from any free point.")
    x, y, z = nearest.position.tolist()
    offer = End((x, y, z), so3.yaw_of(nearest.rotation).item())
    problem = f"the {name} is in occupied space; the nearest free point is ({x:.2f}, {y:.2f}, {z:.2f})."
    return EndReport(question, problem, offer)


def landing(place: Place, question: PointQuestion) -> Landed:
    """Where the robot would stand or hover if it were put on what a click has met."""
    origin = torch.tensor(question.origin)
    direction = torch.nn.functional.normalize(torch.tensor(question.direction), dim=0)
    rendering = render_rays(place.field, origin[None], direction[None])
    if rendering.opacity.item() < _LEAST_OPACITY:
        return Landed(question, None)
    met = origin + rendering.depth.item() * direction
    # as high above it as the body and what it keeps clear of
    x, y, z = (met + torch.tensor([0.0, 0.0, 0.5 * place.robot.body.extents[2] + 0.05])).tolist()
    return Landed(question, (x, y, z))


def view(place: Place, question: ViewQuestion) -> View:
    """The field as the robot's camera would see it."""
    return View(question, tuple(view_from(place, state) for state in question.states))


def view_from(place: Place, state: RigidState) -> np.ndarray:
    """The field as the robot's camera would see it from a state, sRGB bytes."""
    return render_image(place.field, CAMERA, state.pose.compose(FORWARD_MOUNT)).image.numpy()


@torch.no_grad()
def profile(place: Place, question: ProfileQuestion) -> Profile:
    """Clearance and bound on the probability of a collision of each step of a plan."""
    place = planning_place(place, Unknown.OCCUPIED)  # as plans see it
    motion, body, config = question.motion, place.robot.body, SafetyConfig()
    bound = collision_per_step(place.field, motion, body, config.samples_per_step)
    room = [
        clearance_of(place.field, Motion(motion.states[k : k + 2], motion.actions[k : k + 1], motion.dt), body, config)
        for k in range(len(motion.actions))
    ]
    # where nothing is within reach, that is how much room there is at least
    clearance = np.array([config.reach if free is None else free for free in room])
    times = motion.dt * (1 + np.arange(len(room)))
    return Profile(question, np.stack([times, 100 * clearance, 100 * bound.numpy()]))


def eye_view(place: Place, question: EyeQuestion) -> EyeView:
    """The field as it looks from the camera of somebody's tab."""
    eye, width = question.eye, question.width
    height = max(1, round(width / eye.aspect))
    across = 2 * math.degrees(math.atan(eye.aspect * math.tan(eye.fov / 2)))
    camera = Camera.from_fov(width, height, across)
    rotation = torch.from_numpy(tf.SO3(np.array(eye.wxyz)).normalize().as_matrix()).float() @ _FROM_CV
    rendering = render_image(place.field, camera, Pose(rotation, torch.tensor(eye.position)))
    along = -camera.directions(camera.pixels())[:, 2].reshape(height, width)
    depth = torch.where(rendering.opacity > _LEAST_OPACITY, rendering.depth * along, _FAR)
    return EyeView(question, rendering.image.numpy(), depth.numpy())


def space_view(place: Place, question: SpaceQuestion) -> SpaceView:
    """The outermost voxels of a part of space."""
    if question.space is Space.UNKNOWN:
        return _unknown_view(place, question)
    occupancy = occupancy_of(planning_place(place, Unknown.OCCUPIED), OccupancyConfig())
    indices = torch.from_numpy(np.argwhere(_shell(occupancy.by_heading.any(0).numpy())))
    return SpaceView(question, occupancy.centers(indices).numpy(), occupancy.spacing.mean().item())


def _unknown_view(place: Place, question: SpaceQuestion) -> SpaceView:
    """What no camera saw, at every second node: that is as much as a page draws at once."""
    field = place.field
    if not isinstance(field, VoxelField) or field.unknown is None:
        return SpaceView(question, np.zeros((0, 3), np.float32), 0.0)
    inside = _shell(field.unknown.cpu().numpy()[::2, ::2, ::2])
    centers = field.box.lower.cpu().numpy() + 2 * np.argwhere(inside) * field.spacing.cpu().numpy()
    return SpaceView(question, centers.astype(np.float32), 2 * field.spacing.mean().item())


def _shell(inside: np.ndarray) -> np.ndarray:
    """Voxels (nx, ny, nz) that are inside and have a neighbour that is not."""
    padded = np.pad(inside, 1, constant_values=True)  # the wall of the box is no surface
    core = np.ones_like(inside)
    for axis in range(3):
        for step in (-1, 1):
            core &= np.roll(padded, step, axis)[1:-1, 1:-1, 1:-1]
    return inside & ~core


def slice_view(place: Place, question: SliceQuestion) -> SliceView:
    """The density at one height, the denser the brighter and the less transparent."""
    box = place.field.box
    size = box.size
    cells = [max(2, round(_SLICE_CELLS * float(size[axis] / size[:2].max()))) for axis in (0, 1)]
    x, y = (box.lower[axis] + size[axis] * (torch.arange(cells[axis]) + 0.5) / cells[axis] for axis in (0, 1))
    points = torch.cartesian_prod(x, y, box.lower[2:] + question.share * size[2:])
    density = place.field.density(points).reshape(cells)
    dense = (1 - torch.exp(-density / _SLICE_DENSITY)).numpy()
    # from a faint blue through red to yellow, as heat maps go
    color = np.stack([dense**0.5, dense**1.5, 0.5 * (1 - dense), 0.25 + 0.75 * dense], -1)
    return SliceView(question, np.round(255 * color).astype(np.uint8))
