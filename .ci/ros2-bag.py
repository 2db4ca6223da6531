"""Bags from recordings are read by rosbags and by the package mcap-ros2-support.

    python .ci/ros2-bag.py BAG...

Every message of every topic decodes by the standard definition of its type, which is the one in the bag; tf at the time of each pose is
that pose; times are mission time.
"""

import sys
from math import atan2, cos, sin
from pathlib import Path

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore


def plane(at, turn):
    return at.x, at.y, atan2(2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y**2 + turn.z**2))


def within(outer, inner):
    (x, y, turn), (dx, dy, further) = outer, inner
    return x + cos(turn) * dx - sin(turn) * dy, y + sin(turn) * dx + cos(turn) * dy, turn + further


def check(bag):
    store = get_typestore(Stores.ROS2_KILTED)
    counts, tf, poses, fixed = {}, {}, {}, set()
    with Reader(bag) as reader:
        for connection in reader.connections:
            known = connection.msgtype in store.types
            if known:
                standard, _ = store.generate_msgdef(connection.msgtype, ros_version=2)
                ours = connection.msgdef.data
                blocks = [set(text.split("=" * 80 + "\n")) for text in (standard, ours)]
                assert blocks[0] == blocks[1], (connection.msgtype, ours)
            else:
                # The store has the messages of ROS itself alone.
                assert connection.msgtype == "map_msgs/msg/OccupancyGridUpdate"
                store.register(get_types_from_msg(connection.msgdef.data, connection.msgtype))
            latched = connection.ext.offered_qos_profiles
            assert bool(latched) == (connection.topic in ["/tf_static", "/map", "/rosout"]), connection.topic
            assert all(quality.durability.name == "TRANSIENT_LOCAL" for quality in latched)
        begin, end = reader.start_time, reader.end_time
        for connection, at_ns, data in reader.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(data), connection.topic
            topic = connection.topic
            counts[topic] = counts.get(topic, 0) + 1
            assert begin <= at_ns < end
            header = getattr(message, "header", None)
            if header and not topic.startswith("/scan"):
                assert header.stamp.sec * 10**9 + header.stamp.nanosec == at_ns, topic
            if topic == "/tf":
                tf[at_ns] = [(each.header.frame_id, each.child_frame_id, plane(each.transform.translation, each.transform.rotation))
                             for each in message.transforms]
            elif topic == "/tf_static":
                fixed |= {each.child_frame_id for each in message.transforms}
            elif topic == "/pose":
                poses[at_ns] = plane(message.pose.pose.position, message.pose.pose.orientation)
            elif topic.startswith(("/scan", "/range")):
                assert header.frame_id in fixed, header.frame_id
        assert {connection.topic: connection.msgcount for connection in reader.connections if connection.msgcount} == counts
        assert reader.message_count == sum(counts.values())
    assert poses.keys() == tf.keys() and len(poses) > 20
    for at_ns, pose in poses.items():
        (_, odom, origin), (parent, base, moved) = tf[at_ns]
        assert (odom, parent, base) == ("odom", "odom", "base_link")
        x, y, turn = within(origin, moved)
        apart = [x - pose[0], y - pose[1], sin(turn - pose[2])]
        assert max(map(abs, apart)) < 1e-9, (at_ns, apart)
    with open(next(Path(bag).glob("*.mcap")), "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = sum(1 for _ in reader.iter_decoded_messages())
        assert reader.get_header().profile == "ros2" and decoded == sum(counts.values())
    return counts


seen = set()
for bag in sys.argv[1:]:
    counts = check(bag)
    seen |= {topic.split("/")[1] for topic in counts}
    print(f"{bag}: {sum(counts.values())} messages on {len(counts)} topics are read")
promised = "tf tf_static pose odom map map_updates path field movers scan range battery_state diagnostics rosout clock"
assert seen == set(promised.split()), seen
