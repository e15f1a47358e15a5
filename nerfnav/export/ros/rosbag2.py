"""rosbag2: a folder of metadata and an SQLite database, in one zip. Unzip it, then `ros2 bag play FOLDER`."""

import io
import tempfile
import zipfile
from pathlib import Path

from nerfnav.export.recording import Exported, Recording
from nerfnav.export.ros.messages import LATCHED, about, messages, topics
from nerfnav.export.ros.types import quality, typestore
from nerfnav.extras import from_extra

_NAME = "nerfnav_bag"


def rosbag2(recording: Recording) -> Exported:
    """The messages of `nerfnav.export.ros.messages` as a bag of ROS 2 Humble, zipped.

    Raises MissingExtraError without rosbags.
    """
    make_writer = from_extra("rosbags.rosbag2", "ros", "rosbag2").Writer
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
