#!/usr/bin/env python3
"""Runs the drivers of UFACTORY, of Franka and of ROS 2 without a robot.

usage: robot_drivers.py DRIVERS

DRIVERS is the folder with xarm.py, franka.py and ros2.py. Each driver runs as the workbench runs it, with the maker's library in
this Python, in front of what is below: a controller of UFACTORY (port 502 of a loopback address takes root), one of Franka (version
5 of its protocol), and publishers of ROS 2. Where there is no ROS, a stand-in for rclpy is used; where a library is missing, its
checks are skipped. Expected poses are computed here, from matrices. Prints a line per check; exits with 1 when one fails.
"""

import array
import contextlib
import importlib.util
import math
import os
import pathlib
import random
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time
import types

from driver_process import Ended, Talk

# Single precision of the controller's numbers, and its rounding to 1 µm and 1 µrad.
XARM_TOLERANCE = 2e-6
EXACT = 1e-9

# ------------------------------------------------------------------------------------------------------------------- rotations


def product(a, b):
    return [[sum(x * y for x, y in zip(row, column)) for column in zip(*b)] for row in a]


def about(axis, angle):
    """The matrix of a turn about x, y or z."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = [[float(r == c) for c in range(3)] for r in range(3)]
    m[i][i] = m[j][j] = math.cos(angle)
    m[i][j], m[j][i] = -math.sin(angle), math.sin(angle)
    return m


def matrix(q):
    """The matrix of a quaternion x, y, z, w."""
    x, y, z, w = q
    return [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]


def rotation_vector(m):
    angle = math.acos((m[0][0] + m[1][1] + m[2][2] - 1) / 2)
    axis = (m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1])
    return [angle / (2 * math.sin(angle)) * value for value in axis]


def assert_pose(pose, translation, rotation, tolerance):
    off = [abs(a - b) for a, b in zip(pose["translation_m"], translation)]
    off += [abs(a - b) for r, s in zip(matrix(pose["rotation_xyzw"]), rotation) for a, b in zip(r, s)]
    assert max(off) < tolerance, f"{pose} is {max(off)} from {translation} {rotation}"
    assert abs(math.hypot(*pose["rotation_xyzw"]) - 1) < 1e-9, pose


def assert_close(found, expected, tolerance):
    assert len(found) == len(expected) and all(abs(a - b) < tolerance for a, b in zip(found, expected)), f"{found} {expected}"


# ----------------------------------------------------------------------------------------------------------------- conversation


class Skipped(Exception):
    """Why a check cannot run here."""


def need(*modules):
    for module in modules:
        if importlib.util.find_spec(module) is None:
            raise Skipped(f"this Python has no {module}")


def loopback():
    return f"127.{random.randint(1, 250)}.{random.randint(0, 250)}.{random.randint(2, 250)}"


def listen(address, port):
    try:
        return socket.create_server((address, port))
    except PermissionError:
        raise Skipped(f"port {port} takes root") from None


def serve(server, handle):
    """Handles each connection in a thread of its own, until the server is closed."""

    def work(connection):
        with contextlib.suppress(OSError), connection:
            handle(connection)

    def accept():
        with contextlib.suppress(OSError):
            while True:
                threading.Thread(target=work, args=(server.accept()[0],), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()


def received(connection, count):
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise OSError("closed")
        data += part
    return data


# --------------------------------------------------------------------------------------------------------------------- UFACTORY


class Ufactory:
    """A controller of UFACTORY: commands on port 502, and the report of port 30003, as the SDK reads them."""

    # The functions that only read: version, state, number of commands, errors, pose, joints, pose with a rotation vector.
    READ = {1, 13, 14, 15, 41, 42, 91}

    def __init__(self, **changes):
        self.version = "6,6,XI1305,AC1305,v2.5.3"
        self.tip = [312.5, -48.25, 201.125, 0.3, -0.7, 2.1]  # mm, rad
        self.joints = [0.1, -0.2, -0.3, 0.4, 0.5, -0.6, 0.0]
        self.vector = None
        self.state, self.mode, self.error, self.warning = 2, 0, 0, 0
        self.speed, self.answers, self.reports = 0.0, True, True
        vars(self).update(changes)
        self.asked, self.connections = set(), []
        self.address = loopback()
        self.servers = [listen(self.address, 502), listen(self.address, 30003)]
        for server, handle in zip(self.servers, (self.command, self.report)):
            serve(server, handle)

    def rotation(self):
        roll, pitch, yaw = self.tip[3:]
        return product(about(2, yaw), product(about(1, pitch), about(0, roll)))

    def command(self, connection):
        self.connections.append(connection)
        while True:
            transaction, protocol, length = struct.unpack(">HHH", received(connection, 6))
            function = received(connection, length)[0]
            self.asked.add(function)
            if not self.answers:
                continue
            vector = self.vector or rotation_vector(self.rotation())
            answer = {
                1: self.version.encode().ljust(40, b"\0"),
                13: bytes([self.state]),
                14: bytes(2),
                15: bytes([self.error, self.warning]),
                41: struct.pack("<6f", *self.tip),
                42: struct.pack("<7f", *self.joints),
                91: struct.pack("<6f", *self.tip[:3], *vector),
            }.get(function, b"")
            status = 0x40 if self.error else 0x20 if self.warning else 0
            connection.sendall(struct.pack(">HHHBB", transaction, protocol, len(answer) + 2, function, status) + answer)

    def report(self, connection):
        self.connections.append(connection)
        while True:
            if self.reports:
                self.joints[1] += 0.01 * self.speed
                numbers = struct.pack("<20f", *self.joints, *self.tip, *([0.0] * 7))
                connection.sendall(struct.pack(">IBH", 87, self.state | self.mode << 4, 0) + numbers)
            time.sleep(0.01)

    def close(self):
        for part in self.servers + self.connections:
            with contextlib.suppress(OSError):
                part.shutdown(socket.SHUT_RDWR)
            part.close()


def xarm(drivers, controller, *options):
    command = [sys.executable, str(drivers / "xarm.py"), "--host", controller.address, *options]
    # The SDK makes a folder for its log in the home folder.
    return Talk(command, {"HOME": tempfile.gettempdir()})


def xarm_is_read(drivers):
    # The SDK clears warnings that it knows of when it connects.
    controller = Ufactory(warning=11)
    with xarm(drivers, controller, "--urdf", "arm.urdf", "--tip-link", "link6") as talk:
        hello = talk.hello()
        assert hello["name"] == f"UFACTORY xArm 6 at {controller.address}" and hello["can"] == ["state", "joints"], hello
        assert [joint["name"] for joint in hello["joints"]] == [f"joint{i}" for i in range(1, 7)]
        assert hello["arm"] == {"urdf": os.path.realpath(f"{talk.folder.name}/arm.urdf"), "tip_link": "link6"}
        state = talk.state(lambda message: "moving" in message)
        assert_pose(state["base_from_tip"], [0.3125, -0.04825, 0.201125], controller.rotation(), XARM_TOLERANCE)
        assert_close(state["joints_rad"], controller.joints[:6], XARM_TOLERANCE)
        assert state["moving"] is False
        stamps = [talk.state()["stamp"] for _ in range(50)]
        assert sorted(set(stamps)) == stamps and stamps[-1] - stamps[0] < 2.0, stamps
        talk.say(type="ping", id=3)
        assert abs(talk.wait("pong")[0]["stamp"] - stamps[-1]) < 1.0
        talk.refuses_to_move()
        talk.bye()
    assert controller.asked <= Ufactory.READ, controller.asked
    controller.close()


def xarm_tells_motion_and_errors(drivers):
    controller = Ufactory()
    with xarm(drivers, controller) as talk:
        talk.hello()
        talk.log("mode 0 (position control)")
        controller.speed = 0.05
        talk.state(lambda message: message.get("moving") is True)
        controller.speed = 0.0
        talk.state(lambda message: message.get("moving") is False)
        controller.mode = 2
        talk.log("mode 2 (joint teaching)")
        controller.state, controller.error = 4, 1
        assert "Emergency Stop Button" in talk.log("error 1")["text"]
        assert "brakes" in talk.log("state 4 (stopping)")["text"]
        while not talk.messages.empty():
            talk.messages.get()
        time.sleep(0.5)
        assert talk.messages.empty(), "states go on, and the SDK takes no positions"
        controller.state, controller.error, controller.warning = 2, 0, 11
        talk.log("warning 11")
        talk.state()
        talk.bye()
    controller.close()


def xarm_faults(drivers):
    other = Ufactory()
    roll, pitch, yaw = other.tip[3:]
    other.vector = rotation_vector(product(about(0, roll), product(about(1, pitch), about(2, yaw))))
    cases = [
        (other, "another order of axes"),
        (Ufactory(version="2019-03-04 v1.0.1"), "does not state the arm's joints"),
        (Ufactory(answers=False), "does not answer as a controller of UFACTORY"),
        (Ufactory(reports=False), "has sent no report on port 30003"),
    ]
    for controller, expected in cases:
        with xarm(drivers, controller) as talk:
            text = talk.error()
            assert expected in text, text
        controller.close()
    closed = types.SimpleNamespace(address=loopback())
    with xarm(drivers, closed) as talk:
        text = talk.error()
        assert f"no controller answers at {closed.address}:502" in text, text
    controller = Ufactory()
    with xarm(drivers, controller) as talk:
        talk.hello()
        talk.state()
        controller.close()
        text = talk.error()
        assert "closed the connection" in text or "no report" in text, text


def xarm_conventions(drivers):
    import xarm

    generator = random.Random(2)
    for _ in range(200):
        roll, pitch, yaw = (generator.uniform(-4, 4) for _ in range(3))
        expected = product(about(2, yaw), product(about(1, pitch), about(0, roll)))
        assert_pose({"translation_m": [0.0] * 3, "rotation_xyzw": xarm.of_rpy((roll, pitch, yaw))}, [0.0] * 3, expected, EXACT)

    def moves(seconds, joint=0.0, x_mm=0.0, roll=0.0):
        before = xarm.Report(0.0, (0.0,) * 7, (100.0, 0.0, 0.0, math.pi, 0.0, 0.0), 2, 0)
        # Half a turn is the same from both sides.
        tip = (100.0 + x_mm, 0.0, 0.0, -math.pi + roll, 0.0, 0.0)
        return xarm.moves(before, xarm.Report(seconds, (joint, *before.joints[1:]), tip, 2, 0))

    assert [moves(0.05), moves(0.1)] == [None, False]
    assert [moves(0.2, joint=1.9e-3), moves(0.2, joint=-2.1e-3)] == [False, True]
    assert [moves(0.2, x_mm=0.39), moves(0.2, x_mm=0.41)] == [False, True]
    assert [moves(0.2, roll=1.9e-3), moves(0.2, roll=2.1e-3)] == [False, True]


# ----------------------------------------------------------------------------------------------------------------------- Franka


class FrankaController:
    """A controller of Franka with version 5 of the protocol: a handshake over TCP, then packages with the state over UDP."""

    # RobotState of libfranka 0.9: arrays of doubles up to the modes.
    FIELDS = [
        ("O_T_EE", 16), ("O_T_EE_d", 16), ("F_T_EE", 16), ("EE_T_K", 16), ("F_T_NE", 16), ("NE_T_EE", 16), ("m_ee", 1), ("I_ee", 9),
        ("F_x_Cee", 3), ("m_load", 1), ("I_load", 9), ("F_x_Cload", 3), ("elbow", 2), ("elbow_d", 2), ("tau_J", 7), ("tau_J_d", 7),
        ("dtau_J", 7), ("q", 7), ("q_d", 7), ("dq", 7), ("dq_d", 7), ("ddq_d", 7), ("joint_contact", 7), ("cartesian_contact", 6),
        ("joint_collision", 7), ("cartesian_collision", 6), ("tau_ext_hat_filtered", 7), ("O_F_ext_hat_K", 6), ("K_F_ext_hat_K", 6),
        ("O_dP_EE_d", 6), ("O_ddP_O", 3), ("elbow_c", 2), ("delbow_c", 2), ("ddelbow_c", 2), ("O_T_EE_c", 16), ("O_dP_EE_c", 6),
        ("O_ddP_EE_c", 6), ("theta", 7), ("dtheta", 7),
    ]  # fmt: skip
    IDLE, REFLEX = 1, 4
    JOINT_REFLEX = 6

    def __init__(self, **changes):
        self.base_from_flange = ([0.4, -0.1, 0.6], product(about(2, 0.4), product(about(1, 2.9), about(0, 0.2))))
        # The hand's place: 103.4 mm in front of the flange, turned by -45°.
        self.flange_from_tip = ([0.0, 0.0, 0.1034], about(2, -math.pi / 4))
        self.q, self.dq = [0.1, -0.7, 0.2, -2.3, 0.3, 1.6, 0.8], [1e-3] * 7
        self.mode, self.errors, self.version, self.sends, self.message = self.IDLE, set(), 5, True, 1_000_000
        vars(self).update(changes)
        self.commands = []
        self.address = loopback()
        self.server = listen(self.address, 1337)
        serve(self.server, self.command)

    def base_from_tip(self):
        (a, turn), (b, offset) = self.base_from_flange, self.flange_from_tip
        return [x + sum(r * y for r, y in zip(row, b)) for x, row in zip(a, turn)], product(turn, offset)

    @staticmethod
    def by_columns(translation, rotation):
        return [value for column in zip(*rotation) for value in (*column, 0.0)] + [*translation, 1.0]

    def package(self):
        known = {
            "O_T_EE": self.by_columns(*self.base_from_tip()),
            "F_T_EE": self.by_columns(*self.flange_from_tip),
            "q": self.q,
            "dq": self.dq,
        }
        values = [value for name, count in self.FIELDS for value in known.get(name, [0.0] * count)]
        errors = bytes(number in self.errors for number in range(41))
        modes = bytes([0, 3]) + errors + bytes(41) + bytes([self.mode])
        return struct.pack(f"<Q{len(values)}d", self.message, *values) + modes + struct.pack("<d", 1.0)

    def command(self, connection):
        while True:
            command, identity, size = struct.unpack("<III", received(connection, 12))
            request = received(connection, size - 12)
            self.commands.append(command)
            assert command == 0, "only the handshake reads"
            status = 0 if self.version == 5 else 1
            connection.sendall(struct.pack("<IIIBH", 0, identity, 15, status, self.version))
            target = (connection.getpeername()[0], struct.unpack("<HH", request)[1])
            threading.Thread(target=self.send, args=(target,), daemon=True).start()

    def send(self, target):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while self.server.fileno() >= 0:
                if self.sends:
                    self.message += 4
                    out.sendto(self.package(), target)
                time.sleep(0.004)

    def close(self):
        self.server.close()


def franka(drivers, controller, *options):
    return Talk([sys.executable, str(drivers / "franka.py"), "--host", controller.address, *options])


def franka_is_read(drivers):
    need("panda_py")
    controller = FrankaController()
    with franka(drivers, controller) as talk:
        hello = talk.hello()
        assert hello["name"] == f"Franka Emika Robot at {controller.address}" and hello["clock"] == "controller", hello
        assert [joint["name"] for joint in hello["joints"]] == [f"panda_joint{i}" for i in range(1, 8)]
        talk.log("kIdle (idle)")
        state = talk.state()
        assert_pose(state["base_from_tip"], *controller.base_from_tip(), EXACT)
        assert_pose(state["base_from_flange"], *controller.base_from_flange, EXACT)
        assert_close(state["joints_rad"], controller.q, EXACT)
        assert state["moving"] is False
        stamps = [talk.state()["stamp"] for _ in range(50)]
        assert sorted(set(stamps)) == stamps and stamps[0] > 1000.0, stamps
        talk.say(type="ping", id=3)
        assert abs(talk.wait("pong")[0]["stamp"] - stamps[-1]) < 1.0
        talk.refuses_to_move()
        controller.dq = [0.0] * 6 + [-0.05]
        talk.state(lambda message: message["moving"])
        controller.mode, controller.errors = controller.REFLEX, {controller.JOINT_REFLEX}
        line = talk.log("kReflex")
        assert line["level"] == "warn" and "joint_reflex" in line["text"], line
        talk.bye()
    assert controller.commands == [0], controller.commands
    controller.close()


def franka_faults(drivers):
    need("panda_py")
    cases = [
        (FrankaController(version=6), "Install the wheel of panda-py"),
        (FrankaController(sends=False), "sends no states"),
        (FrankaController(flange_from_tip=([0.0] * 3, [[0.0] * 3] * 3)), "not the matrix of a rigid transform"),
    ]
    for controller, expected in cases:
        with franka(drivers, controller) as talk:
            text = talk.error()
            assert expected in text, text
        controller.close()
    with franka(drivers, types.SimpleNamespace(address=loopback())) as talk:
        text = talk.error()
        assert "activate FCI in Desk" in text, text
    controller = FrankaController()
    with franka(drivers, controller) as talk:
        talk.hello()
        controller.sends = False
        text = talk.error()
        assert "sends no states" in text, text
    controller.close()


def matrices_become_quaternions(drivers):
    import franka

    generator = random.Random(1)
    angles = [(generator.uniform(-4, 4), generator.uniform(-4, 4), generator.uniform(-4, 4)) for _ in range(200)]
    angles += [(math.pi, 0, 0), (0, math.pi, 0), (0, 0, math.pi), (0, 0, 0), (math.pi, 1e-9, 0)]
    for a, b, c in angles:
        expected = product(about(2, a), product(about(0, b), about(2, c)))
        _, found = franka.transform("T", FrankaController.by_columns([0.0] * 3, expected))
        assert_pose({"translation_m": [0.0] * 3, "rotation_xyzw": found}, [0.0] * 3, expected, EXACT)


# ------------------------------------------------------------------------------------------------------------------------ ROS 2

WIDTH, HEIGHT = 8, 6
PIXELS = bytes(i % 251 for i in range(WIDTH * HEIGHT * 3))
DEPTHS = bytes(range(WIDTH * HEIGHT)) * 2
LENS = [0.11, -0.21, 0.001, -0.002, 0.03]
TURN = 0.6
# A PNG of 8×6 pixels, from Pillow.
PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000008000000060800000000db6e8027"
    "0000001049444154789c636c60800026061218001bfa008c211746c80000000049454e44ae426082"
)


def scene(make, stamp):
    """What is published: the topic, whether it is kept for those who come later, whether reliably, and the message."""
    header = make("Header", stamp=make("Time", sec=int(stamp), nanosec=int(stamp % 1 * 1e9)), frame_id="base_link")

    def link(parent, child, translation, angle):
        x, y, z = translation
        place = make(
            "Transform",
            translation=make("Vector3", x=x, y=y, z=z),
            rotation=make("Quaternion", x=0.0, y=0.0, z=math.sin(angle / 2), w=math.cos(angle / 2)),
        )
        above = make("Header", stamp=header.stamp, frame_id=parent)
        return make("TransformStamped", header=above, child_frame_id=child, transform=place)

    def image(encoding, data, step):
        size = {"width": WIDTH, "height": HEIGHT, "step": step}
        return make("Image", header=header, encoding=encoding, is_bigendian=0, data=array.array("B", data), **size)

    k, p = [15.5, 0.0, 7.25, 0.0, 15.75, 5.5, 0.0, 0.0, 1.0], [0.0] * 12
    info = {"distortion_model": "plumb_bob", "d": array.array("d", LENS), "k": k, "p": p, "width": WIDTH, "height": HEIGHT}
    joints = {"name": ["elbow", "shoulder", "finger"], "position": array.array("d", [-1.25, 0.5, 0.01])}
    speeds = array.array("d", [0.0, 1e-4, math.nan])
    tree = [link("base_link", "link_1", (0.0, 0.0, 0.3), TURN), link("link_1", "tool0", (0.5, 0.0, 0.0), 0.0)]
    return [
        ("/tf_static", True, True, make("TFMessage", transforms=[link("world", "base_link", (1.0, 2.0, 0.0), 0.3)])),
        ("/tf", False, True, make("TFMessage", transforms=tree)),
        ("/joint_states", False, True, make("JointState", header=header, velocity=speeds, **joints)),
        ("/camera/image_raw", False, False, image("bgr8", PIXELS, 3 * WIDTH)),
        ("/camera/depth", False, False, image("16UC1", DEPTHS, 2 * WIDTH)),
        ("/camera/camera_info", False, True, make("CameraInfo", header=header, **info)),
        ("/camera/compressed", False, False,
         make("CompressedImage", header=header, format="png", data=array.array("B", PNG))),
        ("/header", False, True, header),
    ]  # fmt: skip


def publish():
    """Publishes the scene by ROS until standard input ends."""
    import rclpy
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    packages = [importlib.import_module(f"{name}.msg") for name in ("std_msgs", "geometry_msgs", "sensor_msgs", "tf2_msgs")]
    packages.append(importlib.import_module("builtin_interfaces.msg"))

    def make(name, /, **fields):
        return next(getattr(package, name) for package in packages if hasattr(package, name))(**fields)

    rclpy.init()
    node = rclpy.create_node("robot_drivers")
    publishers = {}
    threading.Thread(target=lambda: [sys.stdin.read(), os._exit(0)], daemon=True).start()
    while True:
        for topic, kept, reliable, message in scene(make, time.time()):
            if topic not in publishers:
                profile = QoSProfile(
                    depth=1,
                    durability=DurabilityPolicy.TRANSIENT_LOCAL if kept else DurabilityPolicy.VOLATILE,
                    reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
                )
                publishers[topic] = node.create_publisher(type(message), topic, profile)
            elif kept:
                continue
            publishers[topic].publish(message)
        time.sleep(0.05)


def run_with_stand_in(drivers, options):
    """Runs ros2.py with modules in the place of rclpy and of its messages: they offer what the driver uses, and no more."""

    def make(name, /, **fields):
        kinds = {"TFMessage": "tf2_msgs/msg/TFMessage", "Header": "std_msgs/msg/Header"}
        message = type(name, (), {"get_fields_and_field_types": staticmethod(lambda: dict.fromkeys(fields, ""))})()
        vars(message).update(fields)
        message.kind = kinds.get(name, f"sensor_msgs/msg/{name}")
        return message

    def now():
        return scene(make, time.time())

    class Node:
        def __init__(self):
            self.callbacks, self.kept = {}, set()

        def get_topic_names_and_types(self):
            return [(topic, [message.kind]) for topic, _, _, message in now()]

        def get_publishers_info_by_topic(self, topic):
            found = []
            for _, kept, reliable, message in (publisher for publisher in now() if publisher[0] == topic):
                offered = {"reliability": "reliable" if reliable else "any", "durability": "kept" if kept else "none"}
                found.append(types.SimpleNamespace(topic_type=message.kind, qos_profile=types.SimpleNamespace(**offered)))
            return found

        def create_subscription(self, kind, topic, callback, profile):
            (offered,) = self.get_publishers_info_by_topic(topic)
            assert vars(profile) == {**vars(offered.qos_profile), "depth": profile.depth} and kind is not None
            self.callbacks[topic] = callback

        def step(self, timeout_sec):
            time.sleep(timeout_sec)
            for topic, kept, _, message in now():
                if topic in self.callbacks and topic not in self.kept:
                    self.callbacks[topic](message)
                    if kept:
                        self.kept.add(topic)

    node = Node()
    executor = types.SimpleNamespace(add_node=lambda _: None, spin_once=node.step)
    kinds = {name: object for name in ("Image", "CompressedImage", "CameraInfo", "JointState", "TFMessage")}
    contents = {
        "rclpy": {"init": lambda args, signal_handler_options: None, "create_node": lambda name, **options: node},
        "rclpy.executors": {"SingleThreadedExecutor": lambda: executor},
        "rclpy.signals": {"SignalHandlerOptions": types.SimpleNamespace(NO=0)},
        "rclpy.qos": {
            "QoSProfile": types.SimpleNamespace,
            "ReliabilityPolicy": types.SimpleNamespace(RELIABLE="reliable", BEST_EFFORT="any"),
            "DurabilityPolicy": types.SimpleNamespace(TRANSIENT_LOCAL="kept", VOLATILE="none"),
        },
        "sensor_msgs.msg": kinds,
        "tf2_msgs.msg": kinds,
    }
    for name, content in contents.items():
        sys.modules[name] = types.ModuleType(name)
        vars(sys.modules[name]).update(content)
    for package in ("sensor_msgs", "tf2_msgs"):
        sys.modules[package] = types.ModuleType(package)
    sys.path.insert(0, drivers)
    sys.argv = ["ros2.py", *options]
    import ros2

    ros2.main()


class Ros:
    """Where there is ROS, its publishers, on this computer only; else the stand-in."""

    def __init__(self, drivers):
        self.drivers = drivers
        self.is_real = all(importlib.util.find_spec(module) for module in ("rclpy", "sensor_msgs", "tf2_msgs"))
        self.environment = {
            "ROS_DOMAIN_ID": str(random.randint(1, 100)), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST", "ROS_LOCALHOST_ONLY": "1",
        }  # fmt: skip
        self.publisher = None
        if self.is_real:
            environment = {**os.environ, **self.environment}
            self.publisher = subprocess.Popen([sys.executable, __file__, "--publish"], stdin=subprocess.PIPE, env=environment)

    def close(self):
        if self.publisher:
            self.publisher.kill()
            self.publisher.wait()

    def driver(self, *options):
        if self.is_real:
            return Talk([sys.executable, str(self.drivers / "ros2.py"), *options], self.environment)
        return Talk([sys.executable, __file__, "--stand-in", str(self.drivers), *options])


FRAMES = ["--base-frame", "world", "--tip-frame", "tool0"]
JOINTS = ["--joints", "/joint_states", "--joint-names", "shoulder,elbow"]
CAMERA = ["--image", "/camera/image_raw", "--camera-info", "/camera/camera_info", "--depth", "/camera/depth"]


def ros_is_read(drivers, ros):
    with ros.driver(*FRAMES, *JOINTS, *CAMERA) as talk:
        hello = talk.hello()
        assert hello["name"].startswith("ROS 2") and hello["can"] == ["state", "joints", "image", "depth"], hello
        assert [joint["name"] for joint in hello["joints"]] == ["shoulder", "elbow"]
        lens = hello["camera"]["intrinsics"]
        assert [lens["fx"], lens["cx"], lens["fy"], lens["cy"]] == [15.5, 7.25, 15.75, 5.5], lens
        assert lens["distortion"] == {"model": "brown_conrady", "coefficients": LENS}
        state = talk.state()
        turn = about(2, 0.3 + TURN)
        tip = [1.0 + 0.5 * turn[0][0], 2.0 + 0.5 * turn[1][0], 0.3]
        assert_pose(state["base_from_tip"], tip, turn, EXACT)
        assert_close(state["joints_rad"], [0.5, -1.25], EXACT)
        talk.say(type="next_image", id=1, after=None, depth=True)
        image, data = talk.wait("image")
        assert (image["width"], image["height"], image["encoding"]) == (WIDTH, HEIGHT, "bgr8") and data == PIXELS
        depth, data = talk.wait("depth")
        assert depth["encoding"] == "u16_mm" and abs(depth["stamp"] - image["stamp"]) < 0.005 and data == DEPTHS
        talk.say(type="next_image", id=2, after=image["stamp"], depth=False)
        assert talk.wait("image")[0]["stamp"] > image["stamp"]
        talk.refuses_to_move()
        talk.bye()


def ros_camera_alone(drivers, ros):
    need("PIL")
    with ros.driver("--image", "/camera/compressed") as talk:
        assert talk.hello()["can"] == ["image"]
        talk.say(type="next_image", id=1, after=None, depth=False)
        image, data = talk.wait("image")
        assert (image["encoding"], data) == ("png", PNG), image
        talk.bye()


def ros_faults(drivers, ros):
    for options, parts in [
        ([], ["--base-frame and --tip-frame", "world\n  base_link\n    link_1\n      tool0"]),
        (["--base-frame", "world", "--tip-frame", "flange"], ['no frame "flange"']),
        (["--image", "/camera/none"], ["nothing comes on /camera/none", "/camera/image_raw (sensor_msgs/msg/Image)"]),
        (["--image", "/header"], ["ROS says: /header has messages of the type std_msgs/msg/Header"]),
        ([*FRAMES, *JOINTS[:2]], ["elbow,shoulder,finger", "--joint-names"]),
    ]:
        with ros.driver(*options) as talk:
            text = talk.error()
            assert all(part in text for part in parts), text


def no_rclpy_says_where_it_is(drivers):
    # Without the site's packages, and where ROS puts its own.
    with Talk([sys.executable, "-S", str(drivers / "ros2.py")], {"PYTHONPATH": ""}) as talk:
        text = talk.error()
        assert "setup.bash" in text and "--python" in text, text


# ------------------------------------------------------------------------------------------------------------------------- main


def main():
    if len(sys.argv) > 1 and sys.argv[1] == "--publish":
        return publish()
    if len(sys.argv) > 2 and sys.argv[1] == "--stand-in":
        return run_with_stand_in(sys.argv[2], sys.argv[3:])
    if len(sys.argv) != 2:
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 2
    drivers = pathlib.Path(sys.argv[1]).resolve()
    has_sdk = importlib.util.find_spec("xarm") is not None  # the driver has the same name
    sys.path.insert(0, str(drivers))
    ros = Ros(drivers)
    before = "ROS 2" if ros.is_real else "a stand-in for rclpy"
    sdk = "UFACTORY's SDK"

    def with_sdk(check):
        def work(folder):
            if not has_sdk:
                raise Skipped("this Python has no xarm-python-sdk")
            check(folder)

        return work

    checks = [
        (f"xarm: {sdk} gives pose, joints and stamps, and asks for nothing that is not reading", with_sdk(xarm_is_read)),
        (f"xarm: motion, modes and errors by {sdk}, and no pose after an emergency stop", with_sdk(xarm_tells_motion_and_errors)),
        (f"xarm: faults of {sdk} say what to do; another order of axes is noticed", with_sdk(xarm_faults)),
        ("xarm: roll, pitch, yaw as the manual has them, and motion by positions", xarm_conventions),
        ("franka: libfranka reads the end effector, the flange, joints, modes and errors, and commands nothing", franka_is_read),
        ("franka: faults say what to do", franka_faults),
        ("franka: matrices by columns become quaternions", matrices_become_quaternions),
        (f"ros2: frames, joints, images, depths and the lens of {before}", lambda folder: ros_is_read(folder, ros)),
        (f"ros2: compressed images of {before}", lambda folder: ros_camera_alone(folder, ros)),
        (f"ros2: what is missing is named, with {before}", lambda folder: ros_faults(folder, ros)),
        ("ros2: without rclpy the fault says how to start it", no_rclpy_says_where_it_is),
    ]
    counts = {"ok": 0, "FAILED": 0, "skipped": 0}
    for name, check in checks:
        try:
            check(drivers)
            result, why = "ok", ""
        except Skipped as reason:
            result, why = "skipped", f" ({reason})"
        except (AssertionError, Ended, subprocess.TimeoutExpired, OSError) as error:
            result, why = "FAILED", f"\n  {type(error).__name__}: {error}"
        counts[result] += 1
        print(f"{result:8} {name}{why}", flush=True)
    ros.close()
    print(f"{counts['ok']} passed, {counts['FAILED']} failed, {counts['skipped']} skipped")
    return 1 if counts["FAILED"] else 0


if __name__ == "__main__":
    sys.exit(main())
