"""What writers of bags in tests share: the messages of robots and cameras, by the writers of `rosbags`."""

from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

TF, JOINTS, IMAGE = "tf2_msgs/msg/TFMessage", "sensor_msgs/msg/JointState", "sensor_msgs/msg/CompressedImage"


def quaternion(r):
    """x, y, z, w of a rotation matrix."""
    w = np.sqrt(max(0.0, 1 + np.trace(r))) / 2
    if w > 0.1:
        v = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) / (4 * w)
        return *v, w
    values, vectors = np.linalg.eigh(r + r.T)
    axis = vectors[:, -1]
    sine = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]]) @ axis / 2
    half = np.arctan2(sine, (np.trace(r) - 1) / 2) / 2
    return *(axis * np.sin(half)), np.cos(half)


class Bag:
    """A bag that is written: `kind` is sqlite3, mcap or ros1, `compression` as the writer of the kind calls it."""

    def __init__(self, path: Path, kind: str, compression: str = ""):
        self.is_ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if TF not in self.store.types:
            # The list of ROS 1 does not have it.
            self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF))
        self.types = self.store.types
        if self.is_ros1:
            self.writer = Writer1(path)
            if compression:
                self.writer.set_compression(Writer1.CompressionFormat[compression.upper()])
        else:
            plugin = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}[kind]
            self.writer = Writer(path, version=8 if kind == "sqlite3" else 9, storage_plugin=plugin)
            if compression:
                self.writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
        self.channels = {}

    def __enter__(self):
        self.writer.__enter__()
        return self

    def __exit__(self, *error):
        return self.writer.__exit__(*error)

    def put(self, topic, time, message, kind):
        if topic not in self.channels:
            self.channels[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialize = self.store.serialize_ros1 if self.is_ros1 else self.store.serialize_cdr
        self.writer.write(self.channels[topic], time, serialize(message, kind))

    def header(self, time, frame):
        stamp = self.types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
        return self.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **({"seq": 1} if self.is_ros1 else {}))

    def transform(self, topic, time, parent, child, m):
        point, turn = self.types["geometry_msgs/msg/Vector3"], self.types["geometry_msgs/msg/Quaternion"]
        pose = self.types["geometry_msgs/msg/Transform"](
            translation=point(*m[:3, 3]), rotation=turn(*quaternion(m[:3, :3]))
        )
        one = self.types["geometry_msgs/msg/TransformStamped"](
            header=self.header(time, parent), child_frame_id=child, transform=pose
        )
        self.put(topic, time, self.types[TF](transforms=[one]), TF)

    def joints(self, topic, time, angles):
        state = self.types[JOINTS](
            header=self.header(time, ""),
            name=[f"joint{i}" for i in range(len(angles))],
            position=angles,
            velocity=np.array([]),
            effort=np.array([]),
        )
        self.put(topic, time, state, JOINTS)

    def image(self, topic, time, data, encoding, recorded=None):
        """An image file; `recorded` is when it reached the recorder, where that is not its stamp."""
        data = np.frombuffer(data, dtype=np.uint8)
        seen = self.types[IMAGE](header=self.header(time, "camera"), format=encoding, data=data)
        self.put(topic, time if recorded is None else recorded, seen, IMAGE)
