"""Records a folder of images with a table of poses as a robot would that goes from view to view, as a bag of ROS.

The robot rests at every view for a second and then moves on; images come all the time. The writers are those of `rosbags`.

usage: write_bag.py FOLDER BAG sqlite3|mcap [file|message|storage]
       write_bag.py FOLDER BAG.bag ros1 [bz2|lz4]
"""

import sys
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from read_recordings import table

TF, JOINTS, IMAGE = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"
STEP_NS = 50_000_000
is_ros1 = sys.argv[3] == "ros1"
store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
if TF not in store.types:
    # The list of ROS 1 does not have it.
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
types = store.types


def quaternion(r):
    w = np.sqrt(max(0.0, 1 + np.trace(r))) / 2
    if w > 0.1:
        v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (4 * w)
        return *v, w
    values, vectors = np.linalg.eigh(r + r.T)
    axis = vectors[:, -1]
    sine = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) @ axis / 2
    half = np.arctan2(sine, (np.trace(r) - 1) / 2) / 2
    return *(axis * np.sin(half)), np.cos(half)


def header(time, frame):
    stamp = types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 1} if is_ros1 else {}))


def transform(time, parent, child, m):
    point, turn = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Quaternion"]
    pose = types["geometry_msgs/msg/Transform"](translation=point(*m[:3, 3]), rotation=turn(*quaternion(m[:3, :3])))
    one = types["geometry_msgs/msg/TransformStamped"](
        header=header(time, parent), child_frame_id=child, transform=pose
    )
    return types[TF](transforms=[one])


folder, bag, kind = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
compression = sys.argv[4] if len(sys.argv) > 4 else ""
poses, _ = table(folder)
if is_ros1:
    writer = Writer1(bag)
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression.upper()])
else:
    plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[kind]
    writer = Writer(bag, version=8 if kind == "sqlite3" else 9, storage_plugin=plugin)
    if compression:
        writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
serialize = store.serialize_ros1 if is_ros1 else store.serialize_cdr
with writer:

    def channel(topic, message):
        return writer.add_connection(topic, message, typestore=store)

    tf, fixed = channel("/tf", TF), channel("/tf_static", TF)
    joints, images = channel("/joint_states", JOINTS), channel("/camera/image/compressed", IMAGE)

    def put(connection, time, message, kind):
        writer.write(connection, time, serialize(message, kind))

    time = 1_700_000_000 * 10**9
    flange = np.eye(4)
    flange[2, 3] = 0.1
    put(fixed, time, transform(time, "link6", "tool0", flange), TF)
    names = list(poses)
    for view, name in enumerate(names):
        here = poses[name]
        there = poses[names[min(view + 1, len(names) - 1)]]
        for step in range(40):
            m = here.copy()
            # The second half of the time it moves.
            m[:3, 3] += (there - here)[:3, 3] * max(0, step - 20) / 20
            put(tf, time, transform(time, "base_link", "link6", m @ np.linalg.inv(flange)), TF)
            angles = np.full(6, view + max(0, step - 20) / 20)
            state = types[JOINTS](
                header=header(time, ""),
                name=[f"joint{i}" for i in range(6)],
                position=angles,
                velocity=np.array([]),
                effort=np.array([]),
            )
            put(joints, time, state, JOINTS)
            if step % 5 == 0:
                data = np.frombuffer((folder / name).read_bytes(), dtype=np.uint8)
                seen = types[IMAGE](header=header(time + 3_000_000, "camera"), format="jpeg", data=data)
                put(images, time + 3_000_000, seen, IMAGE)
            time += STEP_NS
