# /// script
# requires-python = ">=3.9"
# dependencies = []
# ///
r"""A driver for ROS 2 by rclpy. It has not been run with a robot: it is checked with ROS 2 itself and publishers of our own.

rclpy comes with ROS: start this where ROS is set up, and with its Python (docs/drivers/ros2.md). It only reads: it subscribes to
topics and publishes none. Without frames and images it lists the frames of tf.

    handeye driver test "handeye driver ros2"
    handeye driver ros2 \
        --base-frame base_link --tip-frame tool0 --image /camera/image_raw
"""

import importlib
import os
import queue
import threading
import time

from handeye_driver import Fault, parser, serve, within
from rosbridge import TF_STATIC, Rosbridge, chosen_by

# Types of messages that are read. Those of tf are in a package of their own, which may be missing.
TYPES = (
    "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
)  # fmt: skip
# Interval at which publishers are searched for [s].
SEARCH_S = 0.2
# Longest wait for messages in one step [s].
STEP_S = 0.05


class Node:
    """A node that only subscribes, in the place of the connection to rosbridge: what comes is put into `incoming` as rosbridge's
    JSON would have it. All of ROS is used by one thread."""

    speaker = "ROS"

    def __init__(self):
        self.name = f"ROS 2 {os.environ.get('ROS_DISTRO', '')}".rstrip()
        self.incoming = queue.Queue(maxsize=200)
        self.wanted = {}  # topics that have sent nothing: least time between two messages [ms], and length of the queue
        self.subscribed = {}  # by topic: what was subscribed to, and the subscription
        self.known = []  # topics and their types
        self.refused = set()

    def connect(self):
        try:
            import rclpy
            from rclpy.executors import SingleThreadedExecutor
            from rclpy.signals import SignalHandlerOptions
        except ImportError as error:
            raise Fault(
                f"this Python has no rclpy ({error}), which comes with ROS 2, Humble or newer. Start the workbench in a shell "
                "where ROS is set up (source /opt/ros/DISTRO/setup.bash), or name its Python with --python. ROS on another "
                "computer is read by the driver rosbridge"
            ) from None
        # The workbench ends a driver by signals, which have to end the process.
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(f"handeye_driver_{os.getpid()}", enable_rosout=False, start_parameter_services=False)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        threading.Thread(target=self.spin, daemon=True).start()

    def subscribe(self, topic, throttle_ms, queue_length):
        """Asks for a topic, or again for it: the publisher may have come, or changed."""
        self.wanted[topic] = (throttle_ms, queue_length)

    def list_topics(self):
        """They are listed as long as one is searched for."""

    def spin(self):
        searched_s = 0.0
        try:
            while True:
                if self.wanted and time.monotonic() - searched_s > SEARCH_S:
                    searched_s = time.monotonic()
                    self.search()
                self.executor.spin_once(timeout_sec=STEP_S)
        except Fault as fault:
            self.incoming.put(("close", str(fault)))
        except Exception as error:  # nothing would come any more, and nobody would know
            self.incoming.put(("close", f"the node of ROS failed: {error!r}"))

    def search(self):
        """Subscribes to the wanted topics that have publishers."""
        known = [(topic, kind) for topic, kinds in self.node.get_topic_names_and_types() for kind in kinds]
        if known != self.known:
            self.known = known
            self.incoming.put(("topics", known))
        for topic, (throttle_ms, queue_length) in list(self.wanted.items()):
            publishers = self.node.get_publishers_info_by_topic(topic)
            if not publishers:
                continue
            kind = publishers[0].topic_type
            if kind not in TYPES:
                self.complain(f"{topic} has messages of the type {kind}, which is not read")
                continue
            profile = profile_for(topic, publishers, queue_length)
            asked = (kind, profile.reliability, profile.durability)
            old = self.subscribed.get(topic)
            if old is None or old[0] != asked:
                if old is not None:
                    self.node.destroy_subscription(old[1])
                callback = self.passing(topic, throttle_ms / 1000)
                self.subscribed[topic] = (asked, self.node.create_subscription(class_of(kind), topic, callback, profile))

    def passing(self, topic, least_s):
        """What takes the messages of a topic, and leaves out those that come sooner than this after another."""
        last_s = -least_s

        def take(message):
            nonlocal last_s
            self.wanted.pop(topic, None)
            now = time.monotonic()
            if now - last_s >= least_s:
                last_s = now
                self.incoming.put((topic, plain(message)))

        return take

    def complain(self, text):
        if text not in self.refused:
            self.refused.add(text)
            self.incoming.put(("status", {"level": "error", "msg": text}))


def profile_for(topic, publishers, queue_length):
    """The quality of service that these publishers offer: one that asks for more gets nothing."""
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    offered = [publisher.qos_profile for publisher in publishers]
    reliable = all(profile.reliability == ReliabilityPolicy.RELIABLE for profile in offered)
    # Of static frames the earlier messages are needed: tf's own listener asks for them too.
    kept = topic == TF_STATIC or all(profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for profile in offered)
    return QoSProfile(
        depth=queue_length,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
    )


def class_of(kind):
    package, _, name = kind.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.msg"), name)
    except ImportError as error:
        wanted = f"ros-{os.environ.get('ROS_DISTRO', 'DISTRO')}-{package.replace('_', '-')}"
        raise Fault(f"{error}: install {wanted}") from None


def plain(value):
    """A message as rosbridge's JSON has it: objects by the names of their fields. Arrays of numbers stay what they are."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, list):
        return [plain(item) for item in value]
    return value


class Ros2(Rosbridge):
    def take(self, topic, message, outlet):
        try:
            super().take(topic, message, outlet)
        except ImportError as error:
            text = f"compressed images need Pillow ({error}): sudo apt install python3-pil, or name the raw images"
            raise Fault(text) from None


def main():
    options = parser(__doc__)
    add = options.add_argument
    base = "frame of tf in which poses are stated, often base_link; without this and --image, the frames are listed"
    add("--base-frame", metavar="FRAME", help=base)
    add("--tip-frame", metavar="FRAME", help="frame of tf of the tip, often tool0")
    add("--image", metavar="TOPIC", help="topic of images, raw or compressed")
    add("--camera-info", metavar="TOPIC", help="topic of sensor_msgs/CameraInfo, where the lens is calibrated")
    add("--rectified", action="store_true", help="the images are rectified: their lens is the projection matrix alone")
    add("--depth", metavar="TOPIC", help="topic of raw depth images, aligned to the images")
    add("--joints", metavar="TOPIC", help="topic of sensor_msgs/JointState; which joints, say --joint-names or --urdf")
    add("--joint-names", metavar="NAME,…", help="names of the arm's joints from the base up, all revolute")
    add("--urdf", metavar="FILE", help="the arm's URDF: its joints between the base frame and the tip frame")
    add("--image-rate", metavar="HZ", type=within(1, 100, int), default=10, help="images a second at most, 10")
    chosen, joints = chosen_by(options)
    serve(Ros2(chosen, joints, Node()))


if __name__ == "__main__":
    main()
