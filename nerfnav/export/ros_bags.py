"""MCAP: one file of ROS 2 messages with their schemas, which Foxglove opens and `ros2 bag play` plays."""

import io

from nerfnav.core.extras import from_extra
from nerfnav.export.recording import Exported, Recording
from nerfnav.export.ros.messages import LATCHED, about, messages, topics
from nerfnav.export.ros_messages import definition, quality


def mcap(recording: Recording) -> Exported:
    """The messages of `nerfnav.export.ros.messages` in MCAP, profile ros2, encoding cdr.

    Raises MissingExtraError without mcap and rosbags.
    """
    stream, channels, count = io.BytesIO(), {}, 0
    writer = from_extra("mcap.writer", "ros", "MCAP").Writer(stream)
    writer.start(profile="ros2", library="nerfnav")
    writer.add_metadata("nerfnav", about(recording))
    dump = from_extra("rosbags.rosbag2.metadata", "ros", "MCAP").dump_qos_v8
    for topic, kind in topics(recording).items():
        schema = writer.register_schema(kind, "ros2msg", definition(kind).encode())
        channels[topic] = writer.register_channel(
            topic, "cdr", schema, {"offered_qos_profiles": dump([quality(topic in LATCHED)])}
        )
    for message in messages(recording):
        writer.add_message(channels[message.topic], message.time_ns, message.content, message.time_ns)
        count += 1
    writer.finish()
    return Exported(stream.getvalue(), {"messages": count, "topics": list(channels)})
