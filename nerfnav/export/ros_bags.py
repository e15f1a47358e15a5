"""Bags of ROS 2 messages: MCAP and rosbag2.

MCAP is one file of messages with their schemas, which Foxglove opens and `ros2 bag play` plays. rosbag2 is a folder
of metadata and an SQLite database, in one zip: unzip it, then `ros2 bag play FOLDER`.
"""

import io
import tempfile
import zipfile
from pathlib import Path

from nerfnav.core.extras import import_extra
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.ros_messages import LATCHED, about, messages, open_channel, quality, topics, typestore


def mcap(recording: Recording) -> Exported:
    """The messages of `nerfnav.export.ros_messages` in MCAP, profile ros2, encoding cdr.

    Raises MissingExtraError without mcap and rosbags.
    """
    stream, count = io.BytesIO(), 0
    writer = import_extra("mcap.writer", "ros", "MCAP").Writer(stream)
    writer.start(profile="ros2", library="nerfnav")
    writer.add_metadata("nerfnav", about(recording))
    dump = import_extra("rosbags.rosbag2.metadata", "ros", "MCAP").dump_qos_v8
    channels = {
        topic: open_channel(writer, topic, kind, {"offered_qos_profiles": dump([quality(topic in LATCHED)])})
        for topic, kind in topics(recording).items()
    }
    for message in messages(recording):
        writer.add_message(channels[message.topic], message.time_ns, message.content, message.time_ns)
        count += 1
    writer.finish()
    return Exported(stream.getvalue(), {"messages": count, "topics": list(channels)})


_NAME = "nerfnav_bag"


def rosbag2(recording: Recording) -> Exported:
    """The messages of `nerfnav.export.ros_messages` as a bag of ROS 2 Humble, zipped.

    Raises MissingExtraError without rosbags.
    """
    make_writer = import_extra("rosbags.rosbag2", "ros", "rosbag2").Writer
    with tempfile.TemporaryDirectory() as parent:
        folder, count = Path(parent) / _NAME, 0
        with make_writer(folder, version=8) as writer:
            for name, value in about(recording).items():
                writer.set_custom_data(name, value)
            connections = {
                topic: writer.add_connection(
                    topic, kind, typestore=typestore(), offered_qos_profiles=[quality(topic in LATCHED)]
                )
                for topic, kind in topics(recording).items()
            }
            for message in messages(recording):
                writer.write(connections[message.topic], message.time_ns, message.content)
                count += 1
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as packed:
            for path in sorted(folder.iterdir()):
                packed.write(path, f"{_NAME}/{path.name}")
    return Exported(stream.getvalue(), {"messages": count, "topics": list(connections)})
