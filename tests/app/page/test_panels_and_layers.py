"""What the layers and panels make of numbers, without a page."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.glb import parts
from nerfnav.estimator.core.belief import Belief
from nerfnav.export.recording import Subject
from nerfnav.geometry import so3, to_linear, to_srgb, tone_map
from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.planner.steps import PlanCost
from nerfnav.robots.state import RigidState
from nerfnav_app.page.kit.html import caution, fine, table
from nerfnav_app.page.kit.theme import branded, linear
from nerfnav_app.page.layers.camera_modes import compute_view
from nerfnav_app.page.layers.flight import FlightLayer, arrows
from nerfnav_app.page.layers.nodes import dashes, drops, quaternions, segments
from nerfnav_app.page.layers.shapes import Shape, ball, cone, ellipsoids, robot_shape, tube
from nerfnav_app.page.panels.flight import flight as fly_panel
from nerfnav_app.page.panels.plan import ends as ends_panel
from nerfnav_app.page.panels.plan import plan
from nerfnav_app.page.panels.status.next_step import NEXT
from nerfnav_app.page.panels.status.status import describe_activity, describe_landing
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.surface_glb import (
    BRIGHTEST,
    clip_and_fade,
    encode_colored_glb,
    encode_textured_glb,
    remove_specks,
    simplified,
)
from nerfnav_app.state.export_subject import list_subjects, make_recording
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.plan import CostHistory, PlanRecord
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode
from nerfnav_app.text import number, sentence
from tests.app.doubles import balls_place, flight_step, plan_step
from tests.field.fields import painted

ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.1, 0.4)))


def belief_with(covariance: torch.Tensor) -> Belief:
    """A belief at rest whose position has this covariance (3, 3)."""
    full = 1e-4 * torch.eye(12)
    full[:3, :3] = covariance
    return Belief(RigidState.at_rest((0.1, 0.2, 0.3)), full)


@pytest.mark.parametrize("seed", range(5))
def test_ellipsoids_hold_the_95_percent_they_claim(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    factor = 0.05 * torch.randn(3, 3, generator=generator)
    covariance = factor @ factor.T
    centers, wxyzs, half = ellipsoids([belief_with(covariance)])
    draws = (factor @ torch.randn(3, 20_000, generator=generator)).T.double().numpy()
    rotation = so3.matrix_from_quaternion(torch.from_numpy(wxyzs[0])).numpy()
    inside = (((draws @ rotation) / half[0]) ** 2).sum(-1) <= 1
    assert inside.mean() == pytest.approx(0.95, abs=0.01)
    np.testing.assert_allclose(centers[0], [0.1, 0.2, 0.3], atol=1e-6)


def test_an_ellipsoid_of_a_certain_belief_is_tiny_but_has_a_rotation() -> None:
    _, wxyzs, half = ellipsoids([belief_with(torch.zeros(3, 3))])
    assert np.isfinite(wxyzs).all() and np.linalg.norm(wxyzs[0]) == pytest.approx(1)
    assert (half > 0).all() and (half < 1e-3).all()


def test_no_beliefs_make_no_ellipsoids() -> None:
    assert [len(array) for array in ellipsoids([])] == [0, 0, 0]


def test_quaternions_turn_vectors_as_the_rotations_do() -> None:
    rotation = so3.exp(torch.randn(7, 3, generator=torch.Generator().manual_seed(0)))
    zero = torch.zeros(7, 3)
    wxyzs = quaternions(RigidState(zero, zero, rotation, zero))
    back = so3.matrix_from_quaternion(torch.from_numpy(wxyzs))
    torch.testing.assert_close(back, rotation, atol=1e-5, rtol=0)


def test_segments_join_each_point_with_the_next() -> None:
    points = np.arange(12.0).reshape(4, 3)
    joined = segments(points)
    assert joined.shape == (3, 2, 3)
    np.testing.assert_array_equal(joined[:, 0], points[:-1])
    np.testing.assert_array_equal(joined[:, 1], points[1:])


def test_a_line_in_dashes_begins_and_ends_where_it_did_and_has_gaps() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 3, 0]])
    drawn = dashes(points, count=3)
    np.testing.assert_allclose(drawn[0, 0], points[0])
    np.testing.assert_allclose(drawn[-1, 1], points[-1])
    lengths = np.linalg.norm(drawn[:, 1] - drawn[:, 0], axis=1)
    np.testing.assert_allclose(lengths, [0.8, 0.8, 0.8])


def test_the_robot_is_drawn_as_large_as_its_body_with_a_nose_forward() -> None:
    corners = robot_shape((0.1, 0.2, 0.04)).vertices
    lower, upper = corners.min(0), corners.max(0)
    assert upper[0] > 0.05 and lower[0] == pytest.approx(-0.05)
    np.testing.assert_allclose([lower[1:], upper[1:]], [[-0.1, -0.02], [0.1, 0.02]])


def test_what_stands_for_a_body_is_closed_and_seen_from_outside() -> None:
    box = _mesh(Shape(robot_shape((0.1, 0.2, 0.04)).vertices[:8], robot_shape((0.1, 0.2, 0.04)).faces[:12]))
    assert box.is_watertight and box.volume == pytest.approx(8e-4, rel=1e-5)
    round_ = _mesh(ball())
    assert round_.is_watertight and 0.9 < round_.volume / (4 / 3 * np.pi) < 1
    np.testing.assert_allclose(np.linalg.norm(round_.vertices, axis=-1), 1, atol=1e-6)


def test_the_nose_is_seen_from_outside() -> None:
    nose = _mesh(robot_shape((0.1, 0.2, 0.04))).split(only_watertight=False)[1]
    assert (nose.face_normals[:, 0] > 0).all(), "it gets thinner towards the front"
    assert ((nose.triangles_center - nose.centroid)[:, 1:] * nose.face_normals[:, 1:]).sum(-1).min() > 0


def _mesh(shape: Shape) -> trimesh.Trimesh:
    return trimesh.Trimesh(shape.vertices, shape.faces, process=False)


def test_the_surface_reads_back_as_the_same_mesh_with_a_picture_that_is_displayed_in_its_colours() -> None:
    mesh = trimesh.creation.box((1, 2, 3))
    colors = np.random.default_rng(0).integers(60, 190, (8, 3), dtype=np.uint8)
    glb = encode_textured_glb(painted(mesh, colors))
    back = trimesh.load(trimesh.util.wrap_as_stream(glb), file_type="glb", force="mesh", process=False)
    np.testing.assert_allclose(back.vertices, mesh.vertices, atol=1e-6)
    assert sorted(back.faces.tolist()) == sorted(mesh.faces.tolist())
    picture = np.asarray(back.visual.material.baseColorTexture)
    u, v = back.visual.uv.T / 65535
    v = (65537 - 65535 * v) % 65536 / 65535  # which trimesh has turned over within 16 bits
    row, column = (v * picture.shape[0]).astype(int), (u * picture.shape[1]).astype(int)
    displayed = to_srgb(tone_map(BRIGHTEST * to_linear(picture[row, column] / 255)))
    np.testing.assert_allclose(255 * displayed, colors, atol=6)
    assert b"KHR_materials_unlit" in glb and len(glb) % 4 == 0


def test_a_surface_without_a_texture_is_displayed_in_the_colours_of_its_corners() -> None:
    mesh = trimesh.creation.box((1, 2, 3))
    colors = np.random.default_rng(0).integers(60, 190, (8, 3), dtype=np.uint8)
    mesh.visual.vertex_colors = colors
    document, binary = parts(encode_colored_glb(mesh, ([0, 0, 0], [1, 2, 3])))
    view = document["bufferViews"][1]
    light = np.frombuffer(binary, "<u2", 32, view["byteOffset"]).reshape(8, 4) / 65535
    displayed = to_srgb(tone_map(BRIGHTEST * light[:, :3]))
    np.testing.assert_allclose(255 * displayed, colors, atol=1)
    assert (light[:, 3] == 1).all() and document["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][0] == 2
    assert clip_and_fade(encode_colored_glb(mesh), 0.5, 0.5)


def test_a_surface_can_be_cut_at_a_height_and_made_transparent() -> None:
    mesh = trimesh.creation.icosphere(subdivisions=3)
    glb = encode_textured_glb(painted(mesh, np.full((len(mesh.vertices), 3), 200, np.uint8)))
    half = trimesh.load(trimesh.util.wrap_as_stream(clip_and_fade(glb, 0.5, 0.5)), file_type="glb", force="mesh")
    assert half.vertices[half.faces, 2].max() <= 1e-6
    assert len(half.faces) == (mesh.vertices[mesh.faces, 2].max(1) <= 1e-6).sum()
    whole = trimesh.load(trimesh.util.wrap_as_stream(clip_and_fade(glb, 1.0, 1.0)), file_type="glb", force="mesh")
    assert len(whole.faces) == len(mesh.faces)
    thin = parts(clip_and_fade(glb, 0.5, 1.0))[0]["materials"][0]
    assert thin["alphaMode"] == "BLEND" and thin["pbrMetallicRoughness"]["baseColorFactor"][3] == 0.5
    assert "baseColorTexture" in thin["pbrMetallicRoughness"]


def test_specks_are_left_out_of_the_surface_and_large_parts_stay_as_they_are() -> None:
    large, speck = trimesh.creation.icosphere(subdivisions=3), trimesh.creation.box((0.1, 0.1, 0.1))
    speck.apply_translation((3, 0, 0))
    both = trimesh.util.concatenate([speck, large])
    both.visual.vertex_colors = np.random.default_rng(0).integers(0, 256, (len(both.vertices), 3), dtype=np.uint8)
    kept = remove_specks(both, least_faces=50)
    np.testing.assert_allclose(kept.vertices, large.vertices)
    np.testing.assert_array_equal(kept.visual.vertex_colors, both.visual.vertex_colors[len(speck.vertices) :])
    assert len(remove_specks(trimesh.Trimesh(), 50).faces) == 0


@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
def test_a_surface_of_fewer_faces_lies_where_it_lay(size: float) -> None:
    fine = trimesh.creation.icosphere(subdivisions=6, radius=size)
    coarse = simplified(fine)
    assert len(coarse.faces) < 0.2 * len(fine.faces)
    np.testing.assert_allclose(np.linalg.norm(coarse.triangles_center, axis=1), size, rtol=0.01)
    small = trimesh.creation.icosphere(subdivisions=4)
    assert simplified(small) is small, "what is drawn quickly stays as it is"
    assert len(simplified(trimesh.Trimesh()).faces) == 0


def test_linear_colours_follow_the_srgb_curve() -> None:
    np.testing.assert_array_equal(linear(np.array([0, 10, 188, 255])), [0, 1, 128, 255])


def test_the_page_gets_our_title_and_icon() -> None:
    page = branded(b'<head><link\n rel="icon"\n href="data:x"\n/><title>Viser</title></head>')
    assert b"<title>nerfnav</title>" in page and b"data:x" not in page and page.count(b"<link") == 1


def test_chart_data_has_a_column_for_each_term_and_no_zeros() -> None:
    history = CostHistory()
    for iteration in range(5):
        history = history.appended(iteration, PlanCost(0.0, 2.0, 0.5))
    iterations, total, control, collision, limits = plan.chart_data(history)
    assert iterations.tolist() == [0, 1, 2, 3, 4]
    assert total[0] == 2.5 and control[0] == 2.0 and limits[0] == 0.5 and collision[0] > 0


def test_panels_say_what_to_do_while_there_is_nothing_to_show() -> None:
    session = Session.opening("balls")
    assert NEXT[JobKind.PLAN] in plan.describe(None, stale=False, planning=False)
    assert NEXT[JobKind.FLY] in fly_panel.describe(None, stale=False, flying=False)
    assert session.job is not None and session.job.label in describe_activity(session)
    assert list_subjects(session) == () and make_recording(session, Subject.PLAN) is None
    assert ends_panel.describe(session) != ends_panel.describe(replace(session, seeking=True))


@pytest.mark.parametrize("kind", JobKind)
def test_every_kind_of_job_is_said_in_a_line(kind: JobKind) -> None:
    assert len(describe_activity(replace(Session.opening("balls"), job=Job(1, kind)))) > 5


def test_numbers_of_a_flight_carry_their_units() -> None:
    record = FlightRecord(ENDS)
    for index in range(9):
        record = record.with_step(flight_step(ENDS, index, EpisodeOutcome.REACHED if index == 8 else None))
    html = fly_panel.describe(record, stale=False, flying=False)
    assert all(text in html for text in ("0.8 s", "1 cm", "1 ms", "2 ms", sentence(EpisodeOutcome.REACHED.value)))


def test_a_robot_that_only_believes_to_have_arrived_is_amber_and_says_how_far_away_it_is() -> None:
    steps = tuple(flight_step(ENDS, index) for index in range(8))
    there = FlightRecord(ENDS, (*steps, flight_step(ENDS, 8, EpisodeOutcome.REACHED)))
    away = FlightRecord(ENDS, (*steps[:6], flight_step(ENDS, 6, EpisodeOutcome.REACHED)))
    assert describe_landing(there) == "Arrived after 0.8 s, 0 cm from the goal"
    assert describe_landing(away) == "Believes to have arrived after 0.6 s, 35 cm from the goal"
    assert (fly_panel.format_landing(there), fly_panel.format_landing(away)) == (fine, caution)
    assert "believes to be at the goal, 35 cm away" in fly_panel.describe(away, stale=False, flying=False)


def test_numbers_of_a_flight_with_the_settings_before_say_so() -> None:
    record = FlightRecord(ENDS, (flight_step(ENDS, 8, EpisodeOutcome.REACHED),))
    marked, plain = (fly_panel.describe(record, stale=False, flying=False, old=old) for old in ("settings", ""))
    assert marked.startswith(caution("These are the numbers of the flight with the old settings."))
    assert marked.endswith(plain)


def test_before_a_flight_the_plan_alone_can_be_taken_away() -> None:
    place = balls_place()
    session = Session("balls", place=place, ends=ENDS, plan=PlanRecord(ENDS).with_step(plan_step(ENDS, 0)))
    made = make_recording(session, Subject.PLAN)
    assert list_subjects(session) == (Subject.PLAN,) and made is not None and len(made.times) == 9
    np.testing.assert_allclose(made.position[-1], ENDS.goal.position, atol=1e-6)


def test_html_from_data_is_escaped() -> None:
    assert "<script>" not in table([("<script>", "<b>")])


@pytest.mark.parametrize(
    ("value", "unit", "text"), [(0.01234, "m", "0.0123 m"), (2.0, "", "2"), (123456.0, "ms", "123456 ms")]
)
def test_numbers_read_well(value: float, unit: str, text: str) -> None:
    assert number(value, unit) == text


def test_the_cone_of_the_attitude_holds_what_the_covariance_says_and_grows_with_the_scale() -> None:
    std = torch.tensor([0.02, 0.05, 0.1])
    covariance = torch.diag(torch.cat([torch.full((6,), 1e-4), std.square(), torch.full((3,), 1e-4)]))
    belief = Belief(RigidState.at_rest((0.0, 0.0, 1.0)), covariance)
    lines = cone(belief)
    assert np.allclose(lines[:, 0], [0, 0, 1])
    tips = (lines[:, 1] - lines[:, 0]) / np.linalg.norm(lines[:, 1] - lines[:, 0], axis=-1, keepdims=True)
    # yaw moves the nose sideways, pitch up and down; 2.7955 standard deviations hold 95 % of three numbers
    assert np.abs(tips[:, 1]).max() == pytest.approx(np.sin(2.7955 * 0.1), rel=1e-3)
    assert np.abs(tips[:, 2]).max() == pytest.approx(np.sin(2.7955 * 0.05), rel=1e-3)
    wider = cone(belief, 2.0)
    assert np.abs(wider[:, 1, 1]).max() > 1.8 * np.abs(lines[:, 1, 1]).max()


class _Label:
    visible, text, position = False, "", (0.0, 0.0, 0.0)


class _Drawn:
    """Keeps what was last drawn, in place of bodies of a page."""

    def show(self, centers: np.ndarray, wxyzs: np.ndarray, scales: np.ndarray) -> None:
        self.scales = scales


def test_a_lost_robots_ellipsoid_is_capped_alone_and_labelled() -> None:
    layer = FlightLayer.__new__(FlightLayer)
    layer._covariance, layer._lost, layer._size_label = _Drawn(), _Drawn(), _Label()  # type: ignore[assignment]
    sure, lost = belief_with(1e-4 * torch.eye(3)), belief_with(1.31 * torch.eye(3))
    layer._show_covariances([sure, lost, lost], 1.0, 3.0)
    assert len(layer._covariance.scales) == 1 and len(layer._lost.scales) == 1  # type: ignore[attr-defined]
    assert layer._lost.scales.max() == pytest.approx(0.3)  # type: ignore[attr-defined]
    assert layer._size_label.visible and layer._size_label.text == "position ± 3.2 m, drawn smaller"
    layer._show_covariances([lost, sure], 3.0, 3.0)
    assert not layer._size_label.visible and len(layer._lost.scales) == 0  # type: ignore[attr-defined]
    assert layer._covariance.scales.max() == pytest.approx(3 * 2.7955e-2, rel=1e-3)  # type: ignore[attr-defined]
    layer._show_covariances([], 1.0, 3.0)
    assert not layer._size_label.visible and len(layer._covariance.scales) == 0  # type: ignore[attr-defined]


def test_an_ellipsoid_that_is_drawn_larger_than_it_is_does_not_flood_the_place() -> None:
    layer = FlightLayer.__new__(FlightLayer)
    layer._covariance, layer._lost, layer._size_label = _Drawn(), _Drawn(), _Label()  # type: ignore[assignment]
    unsure = belief_with(0.04**2 * torch.eye(3))  # half axes of 11 cm
    layer._show_covariances([unsure, unsure], 1.0, 2.0)
    assert len(layer._covariance.scales) == 2 and not layer._size_label.visible  # type: ignore[attr-defined]
    layer._show_covariances([unsure, unsure], 5.0, 2.0)
    assert len(layer._covariance.scales) == 0 and len(layer._lost.scales) == 1  # type: ignore[attr-defined]
    assert layer._lost.scales.max() == pytest.approx(0.2)  # type: ignore[attr-defined]
    assert layer._size_label.text == "position ± 0.11 m, drawn smaller"


def test_the_tube_around_a_plan_has_the_room_for_noise_on_all_sides_and_is_closed() -> None:
    centers = np.stack([np.linspace(0, 1, 11), np.zeros(11), np.full(11, 0.5)], -1)
    drawn = tube(centers, 0.1, np.tile([0.04, 0.02], (11, 1)))
    beside = drawn.vertices[np.abs(drawn.vertices[:, 0] - 0.5) < 1e-6] - [0.5, 0, 0.5]
    assert np.abs(beside[:, 1]).max() == pytest.approx(0.18) and np.abs(beside[:, 2]).max() == pytest.approx(0.14)
    assert drawn.vertices[:, 0].min() == pytest.approx(-0.18) and drawn.vertices[:, 0].max() == pytest.approx(1.18)
    mesh = _mesh(drawn)
    mesh.merge_vertices()
    assert mesh.volume > 0, "its outside is drawn"


def test_the_tube_around_a_plan_that_rests_or_climbs_is_finite() -> None:
    for centers in (np.zeros((4, 3)), np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 1], [0, 0, 2]])):
        assert np.isfinite(tube(centers, 0.1, np.full((4, 2), 0.03)).vertices).all()


def test_an_arrow_points_to_where_a_gust_blew_the_robot() -> None:
    steps = tuple(flight_step(ENDS, index) for index in range(4))
    drawn = arrows(steps, (2, 9))
    assert drawn is not None
    (tail, tip), *barbs = drawn
    np.testing.assert_allclose(tip, steps[2].truth.position.numpy(), atol=1e-6)
    blown = tip - steps[1].plan.states.position[1].numpy()
    if np.linalg.norm(blown) > 1e-6:
        assert (tip - tail) @ blown > 0
    assert len(barbs) == 2 and arrows(steps, ()) is None


def test_drop_lines_are_vertical_and_end_on_the_floor() -> None:
    points = np.array([[0.1, 0.2, 1.0], [0.3, 0.4, 2.0]])
    lines = drops(points, -0.5)
    np.testing.assert_allclose(lines[:, 0], points)
    np.testing.assert_allclose(lines[:, 1], [[0.1, 0.2, -0.5], [0.3, 0.4, -0.5]])


@pytest.mark.parametrize("mode", [mode for mode in CameraMode if mode is not CameraMode.FREE])
def test_cameras_look_where_the_robot_is_or_goes(mode: CameraMode) -> None:
    place = balls_place()
    state = End((0.2, 0.1, 0.5), yaw=0.7).state()
    eye, target = compute_view(mode, state, place.robot, place.field.box)
    at, ahead = state.position.double().numpy(), state.rotation.double().numpy()[:, 0]
    assert np.isfinite(eye).all() and np.linalg.norm(target - eye) > 0.1
    if mode is CameraMode.TOP:
        assert eye[2] > place.field.box.upper[2] and abs(eye[0] - target[0]) < 1e-6
    else:
        assert (target - eye) @ ahead > 0
        assert ((eye - at) @ ahead < 0) == (mode is CameraMode.CHASE)
