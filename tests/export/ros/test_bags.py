"""MCAP and rosbag2, read back by the readers that others use."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.interfaces import QosDurability
from rosbags.rosbag2 import Reader

from nerfnav.estimator.core.belief import Belief
from nerfnav.export.recording import Recording
from nerfnav.export.ros_bags import mcap, rosbag2
from nerfnav.export.ros_messages import pose_covariance, typestore
from nerfnav.geometry import so3
from tests.export.flights import flight, flown, plan

Messages = dict[str, list[tuple[int, Any]]]


def mcap_messages(recording: Recording) -> Messages:
    """Topic to times [ns] and messages, as an MCAP reader has them."""
    found: Messages = {}
    reader = make_reader(io.BytesIO(mcap(recording).content))
    assert reader.get_header().profile == "ros2"
    for schema, channel, message in reader.iter_messages():
        assert schema is not None and schema.encoding == "ros2msg" and channel.message_encoding == "cdr"
        content = typestore().deserialize_cdr(message.data, schema.name)
        found.setdefault(channel.topic, []).append((message.log_time, content))
    return found


def bag_messages(recording: Recording, folder: Path) -> Messages:
    """The same of a rosbag2."""
    with zipfile.ZipFile(io.BytesIO(rosbag2(recording).content)) as packed:
        packed.extractall(folder)
    found: Messages = {}
    with Reader(folder / "nerfnav_bag") as reader:
        for connection, time, data in reader.messages():
            content = typestore().deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, content))
    return found


def decoded(recording: Recording, topic: str) -> list[Any]:
    """Messages of a topic, as mcap-ros2-support reads them by the definitions in the file."""
    reader = make_reader(io.BytesIO(mcap(recording).content), decoder_factories=[DecoderFactory()])
    return [message for *_, message in reader.iter_decoded_messages(topics=[topic])]


@pytest.fixture(params=["mcap", "rosbag2"])
def read_back(request: pytest.FixtureRequest, tmp_path: Path) -> Messages:
    recording = flight()
    return mcap_messages(recording) if request.param == "mcap" else bag_messages(recording, tmp_path)


def test_odometry_is_the_pose_in_the_world_and_velocities_in_the_body(read_back: Messages) -> None:
    odometry, steps = read_back["/odometry"], flown()
    assert len(odometry) == len(steps)
    for (time, message), step in zip(odometry, steps, strict=True):
        stamp = message.header.stamp
        assert time == 10**9 * stamp.sec + stamp.nanosec == pytest.approx(1e9 * step.time, abs=1e3)
        assert (message.header.frame_id, message.child_frame_id) == ("map", "base_link")
        p, q, v, w = (
            message.pose.pose.position, message.pose.pose.orientation,
            message.twist.twist.linear, message.twist.twist.angular,
        )  # fmt: skip
        np.testing.assert_allclose([p.x, p.y, p.z], step.truth.position, atol=1e-6)
        rotation = so3.matrix_from_quaternion(torch.tensor([q.w, q.x, q.y, q.z], dtype=torch.float64))
        np.testing.assert_allclose(rotation, step.truth.rotation, atol=1e-6)
        np.testing.assert_allclose(rotation @ torch.tensor([v.x, v.y, v.z]).double(), step.truth.velocity, atol=1e-6)
        np.testing.assert_allclose([w.x, w.y, w.z], step.truth.body_rate, atol=1e-6)


def test_the_path_holds_all_poses_at_once(read_back: Messages) -> None:
    ((time, path),) = read_back["/path"]
    assert time == 0
    points = [[pose.pose.position.x, pose.pose.position.y, pose.pose.position.z] for pose in path.poses]
    np.testing.assert_allclose(points, torch.stack([step.truth.position for step in flown()]), atol=1e-6)


def test_the_estimate_comes_with_its_covariance(read_back: Messages) -> None:
    for (_, message), step in zip(read_back["/estimate"], flown(), strict=True):
        p = message.pose.pose.position
        np.testing.assert_allclose([p.x, p.y, p.z], step.belief.mean.position, atol=1e-6)
        np.testing.assert_allclose(message.pose.covariance, pose_covariance(step), atol=1e-12)


def test_attitudes_spread_about_the_axes_of_the_world() -> None:
    step = flown()[5]
    covariance = torch.diag(torch.tensor([0.0] * 6 + [0.04, 0.0, 0.0] + [0.0] * 3))
    turned = pose_covariance(type(step)(**{**vars(step), "belief": Belief(step.belief.mean, covariance)}))
    axis = step.belief.mean.rotation.double()[:, 0]
    np.testing.assert_allclose(turned.reshape(6, 6)[3:, 3:], 0.04 * torch.outer(axis, axis), atol=1e-9)
    assert not turned.reshape(6, 6)[:3].any()


def test_a_plan_has_no_estimate(tmp_path: Path) -> None:
    reported = {"/about", "/path", "/odometry", "/tf"}
    assert set(mcap_messages(plan())) == set(bag_messages(plan(), tmp_path)) == reported


def test_a_reader_of_ros_2_finds_the_transforms_from_map_to_base_link() -> None:
    for message, step in zip(decoded(flight(), "/tf"), flown(), strict=True):
        (stamped,) = message.transforms
        assert (stamped.header.frame_id, stamped.child_frame_id) == ("map", "base_link")
        t, q = stamped.transform.translation, stamped.transform.rotation
        np.testing.assert_allclose([t.x, t.y, t.z], step.truth.position, atol=1e-6)
        rotation = so3.matrix_from_quaternion(torch.tensor([q.w, q.x, q.y, q.z], dtype=torch.float64))
        np.testing.assert_allclose(rotation, step.truth.rotation, atol=1e-6)


def test_a_reader_of_ros_2_finds_the_pictures_of_a_flight() -> None:
    reported = decoded(flight(), "/picture")
    assert len(reported) == sum(step.image is not None for step in flown()) > 0
    picture, first = reported[0], next(step.image for step in flown() if step.image is not None)
    assert (picture.format, picture.header.frame_id) == ("jpeg", "base_link")
    read = cv2.imdecode(np.frombuffer(picture.data, np.uint8), cv2.IMREAD_COLOR)
    assert read is not None and read.shape == tuple(first.shape)
    assert np.abs(read[..., ::-1].astype(int) - first.numpy()).mean() < 12, "another picture"


def test_quaternions_of_the_estimate_do_not_flip_their_signs() -> None:
    read = [message.pose.pose.orientation for message in decoded(flight(60, size=2), "/estimate")]
    quaternions = np.array([[q.w, q.x, q.y, q.z] for q in read])
    assert (quaternions[1:] * quaternions[:-1]).sum(-1).min() > 0.9


def test_path_and_about_are_latched_and_say_what_the_odometry_is(tmp_path: Path) -> None:
    with zipfile.ZipFile(io.BytesIO(rosbag2(flight()).content)) as packed:
        packed.extractall(tmp_path)
    with Reader(tmp_path / "nerfnav_bag") as reader:
        offered = {one.topic: one.ext.offered_qos_profiles[0].durability for one in reader.connections}
        custom = yaml.safe_load((tmp_path / "nerfnav_bag" / "metadata.yaml").read_text())
    latched = {topic for topic, durability in offered.items() if durability is QosDurability.TRANSIENT_LOCAL}
    assert latched == {"/path", "/about"}
    read = make_reader(io.BytesIO(mcap(flight()).content))
    summary = read.get_summary()
    assert summary is not None
    for channel in summary.channels.values():
        durability = yaml.safe_load(channel.metadata["offered_qos_profiles"])[0]["durability"]
        assert durability == (1 if channel.topic in latched else 2)
    (about,) = decoded(flight(), "/about")
    (metadata,) = read.iter_metadata()
    reported = custom["rosbag2_bagfile_information"]["custom_data"]
    assert json.loads(about.data) == metadata.metadata == reported
    assert reported["outcome"] == "collided" and "the true state in the simulation, exact" in reported["odometry"]
