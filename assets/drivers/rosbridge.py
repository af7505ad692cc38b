# /// script
# requires-python = ">=3.9"
# dependencies = ["roslibpy>=2.1,<2.2", "pillow>=10,<14"]
# ///
r"""A driver of Handeye Workbench that reads a robot and a camera of ROS 1 or ROS 2 through rosbridge (docs/drivers/rosbridge.md).

It only reads: it subscribes to topics and publishes none. Without frames and images it lists the frames of tf.

    handeye driver test "handeye driver rosbridge --url ws://192.168.0.7:9090"
    handeye driver rosbridge --url ws://192.168.0.7:9090 \
        --base-frame base_link --tip-frame tool0 --image /camera/image_raw
"""

import array
import base64
import bisect
import collections
import io
import math
import os
import queue
import socket
import time
import urllib.parse
from xml.etree import ElementTree

from handeye_driver import Fault, conjugate, parser, pose, serve, times, turned, within

PORT = 9090
TF, TF_STATIC = "/tf", "/tf_static"
# How long a connection may take [s].
PATIENCE_S = 4
# Interval at which rosbridge is pinged, and the time without an answer after which it counts as gone [s].
PING_S, SILENCE_S = 2, 4
# Longest message in bytes: an image of 4k in base64, and room to spare.
MOST_BYTES = 64 << 20
# How long the first messages of topics may take [s]: less than the workbench waits for `hello`.
FIRST_S = 7.0
# How long frames are collected before they are listed for the user [s].
LISTING_S = 3.0
# Interval at which a topic without a publisher is subscribed to again [s].
AGAIN_S = 2.0
# Longest time between checks whether the workbench is gone, and between states of an arm at rest [s].
TICK_S = 0.05
# States are no closer than this [s]: 500 a second.
CLOSEST_S = 0.002
# A clock that goes back by more than this [s] was set.
RESET_S = 1.0
# This long without a new pose [s] is worth a line in the log.
STALE_S = 2.0
# Image and depth image of one exposure have stamps no further apart [s].
ONE_INSTANT_S = 0.005
# How far the norm of a quaternion of tf may be from 1: rounding to three digits is within, zeros of a field never set are not.
UNIT_TOLERANCE = 1e-3
# Bounds on untrusted input: frames, links of a chain, values of a stream, pieces of messages, sides of an image.
MOST_FRAMES, LONGEST_CHAIN, MOST_SAMPLES, MOST_PIECES, MOST_SIDE = 2000, 200, 512, 65_536, 16_384
# Types of messages that are read, by their suffixes.
READ = ("/Image", "/CompressedImage", "/CameraInfo", "/JointState", "/TFMessage")


# ------------------------------------------------------------------------------------------------------------- values in time


class Samples:
    """What a quantity was of late."""

    def __init__(self):
        self.stamps, self.values = [], []

    def push(self, stamp, value):
        """Takes a value. One that is older than the newest begins the stream again: a recording is played from its start."""
        if self.stamps and stamp < self.stamps[-1]:
            self.clear()
        if self.stamps and stamp == self.stamps[-1]:
            self.values[-1] = value
            return
        self.stamps.append(stamp)
        self.values.append(value)
        if len(self.stamps) > MOST_SAMPLES:
            del self.stamps[0], self.values[0]

    def clear(self):
        self.stamps.clear()
        self.values.clear()

    def last(self):
        return self.stamps[-1] if self.stamps else None

    def at(self, stamp, between):
        """The value at an instant that lies among the samples; None at others."""
        after = bisect.bisect_left(self.stamps, stamp)
        if after == len(self.stamps):
            return None
        if self.stamps[after] == stamp:
            return self.values[after]
        if after == 0:
            return None
        begin, end = self.stamps[after - 1], self.stamps[after]
        return between(self.values[after - 1], self.values[after], (stamp - begin) / (end - begin))


def line(a, b, share):
    """Between two lists of numbers."""
    return tuple(x + share * (y - x) for x, y in zip(a, b))


# A rigid transform is a pair: translation x, y, z and unit quaternion x, y, z, w.
IDENTITY = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def compose(a, b):
    return tuple(x + y for x, y in zip(a[0], turned(a[1], b[0]))), times(a[1], b[1])


def inverse(a):
    q = conjugate(a[1])
    return tuple(-x for x in turned(q, a[0])), q


def between_poses(a, b, share):
    """On the straight line, turning evenly about one axis."""
    p, q = a[1], b[1]
    cosine = sum(x * y for x, y in zip(p, q))
    if cosine < 0:  # the other quaternion of the same rotation is nearer
        q, cosine = tuple(-x for x in q), -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-9:
        return line(a[0], b[0], share), p
    left, right = math.sin((1 - share) * angle) / math.sin(angle), math.sin(share * angle) / math.sin(angle)
    return line(a[0], b[0], share), tuple(left * x + right * y for x, y in zip(p, q))


# --------------------------------------------------------------------------------------------------------------------- frames


class NoChain(Exception):
    """Why there is no pose of one frame in another."""


Link = collections.namedtuple("Link", "parent is_static samples")


def bare(frame):
    """ROS 1 wrote some names with a slash in front."""
    return frame[1:] if frame.startswith("/") else frame


class Tree:
    """Which frame hangs on which, and where, as tf's messages build it."""

    def __init__(self):
        self.links = {}  # by the name of the child

    def insert(self, parent, child, stamp, transform, is_static):
        """Takes a transform. False when there is no room for it."""
        parent, child = bare(parent), bare(child)
        link = self.links.get(child)
        if link is None and len(self.links) >= MOST_FRAMES:
            return False
        if link is None or (link.parent, link.is_static) != (parent, is_static):
            link = self.links[child] = Link(parent, is_static, Samples())
        if is_static:
            link.samples.clear()
        link.samples.push(stamp, transform)
        return True

    def describe(self):
        """All frames, each below the one that it hangs on."""
        most = 60
        children = collections.defaultdict(list)
        for child in sorted(self.links):
            children[self.links[child].parent].append(child)
        lines, rest = [], [(root, 0) for root in sorted(children, reverse=True) if root not in self.links]
        while rest:
            if len(lines) == most:
                lines.append(f"and {len(self.links) - most} more")
                break
            frame, depth = rest.pop()
            lines.append("  " * depth + frame)
            if depth < LONGEST_CHAIN:
                rest += [(child, depth + 1) for child in reversed(children[frame])]
        return "\n".join(lines)

    def newest(self, base, tip, limit=math.inf):
        """The newest instant, not after the limit, at which the whole chain is known, and base_from_tip then. The instant is
        None where nothing of the chain moves."""
        base, tip = bare(base), bare(tip)
        of_base, of_tip = self.to_root(base), self.to_root(tip)
        ancestor = next((frame for frame in of_tip if frame in of_base), None)
        if ancestor is None:
            raise NoChain(f'tf has no chain from "{base}" to "{tip}": one hangs on "{of_base[-1]}", the other on "{of_tip[-1]}"')
        up, down = of_base[: of_base.index(ancestor)], of_tip[: of_tip.index(ancestor)]
        moving = [self.links[frame].samples.last() for frame in up + down if not self.links[frame].is_static]
        instant = min([*moving, limit]) if moving else None
        ancestor_from_base, ancestor_from_tip = self.product(up, instant), self.product(down, instant)
        if ancestor_from_base is None or ancestor_from_tip is None:
            raise NoChain(f'the transforms between "{base}" and "{tip}" have no instant in common')
        return instant, compose(inverse(ancestor_from_base), ancestor_from_tip)

    def product(self, frames, instant):
        whole = IDENTITY
        for frame in frames:
            link = self.links[frame]
            transform = link.samples.values[-1] if link.is_static else link.samples.at(instant, between_poses)
            if transform is None:
                return None
            whole = compose(transform, whole)
        return whole

    def to_root(self, frame):
        """The frame, what it hangs on, and so on."""
        if frame not in self.links and not any(link.parent == frame for link in self.links.values()):
            raise NoChain(f'tf has no frame "{frame}"')
        chain = [frame]
        while chain[-1] in self.links and len(chain) < LONGEST_CHAIN:
            chain.append(self.links[chain[-1]].parent)
        return chain


class Joints:
    """Joint values, in the order of the arm."""

    def __init__(self, names):
        self.names, self.samples, self.seen = names, Samples(), []

    def take(self, message):
        """Takes a message. One that lacks a joint says nothing: another publisher has it."""
        self.seen = message["name"][:64]
        values = dict(zip(message["name"], message["position"]))
        found = [values.get(name) for name in self.names]
        if found and None not in found:
            self.samples.push(seconds(message), tuple(map(float, found)))


def joints_of_urdf(path, base, tip):
    """The joints that move between two links of a URDF, from the base up, as `hello` has them."""
    try:
        robot = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError) as error:
        raise Fault(f"{path}: {error}") from None
    above = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    chain, link = [], tip
    while link != base:
        if link not in above or len(chain) > LONGEST_CHAIN:
            raise Fault(f"{path}: there is no chain of joints from {base} to {tip}")
        chain.append(above[link])
        link = above[link].find("parent").get("link")
    return [joint_of_urdf(path, joint) for joint in reversed(chain) if joint.get("type") != "fixed"]


def joint_of_urdf(path, joint):
    name, kind = joint.get("name"), joint.get("type")
    if kind not in ("revolute", "continuous", "prismatic") or joint.find("mimic") is not None:
        raise Fault(f"{path}: joint {name} ({kind}) is neither revolute nor prismatic with a value of its own")
    limit = joint.find("limit")
    limits = {}
    if kind != "continuous" and limit is not None:
        limits = {"min": float(limit.get("lower", 0)), "max": float(limit.get("upper", 0))}
    return {"name": name, "kind": "prismatic" if kind == "prismatic" else "revolute", **limits}


# --------------------------------------------------------------------------------------------------------------------- images


def seconds(message):
    """The stamp of a message: `secs` and `nsecs` in ROS 1, `sec` and `nanosec` in ROS 2."""
    stamp = message["header"]["stamp"]
    if "secs" in stamp:
        return stamp["secs"] + 1e-9 * stamp["nsecs"]
    return stamp["sec"] + 1e-9 * stamp["nanosec"]


def data_of(message):
    """The bytes of an image, which are base64 or a list of numbers."""
    data = message["data"]
    return base64.b64decode(data) if isinstance(data, str) else bytes(data)


def picture(message):
    """Bytes and fields of a colour or grey image."""
    data = data_of(message)
    if "format" in message:
        encoding, (width, height) = compressed(message["format"], data)
        return data, {"stamp": seconds(message), "width": width, "height": height, "encoding": encoding}
    known = {"rgb8": (3, "rgb8"), "bgr8": (3, "bgr8"), "rgba8": (4, "rgb8"), "bgra8": (4, "bgr8"), "mono8": (1, "mono8")}
    if message["encoding"] not in known:
        raise Fault(
            f"images are of the encoding {message['encoding']!r}; {', '.join(known)} and compressed images are read. Name a topic "
            "that has one of them, such as that of image_proc (…/image_color, …/image_mono)"
        )
    channels, encoding = known[message["encoding"]]
    pixels = rows(message, data, channels)
    if channels == 4:
        colours = bytearray(len(pixels) // 4 * 3)
        for channel in range(3):
            colours[channel::3] = pixels[channel::4]
        pixels = bytes(colours)
    size = {"width": message["width"], "height": message["height"]}
    return pixels, {"stamp": seconds(message), **size, "encoding": encoding}


def compressed(form, data):
    """JPEG or PNG, by what the bytes are: the text of the format differs between publishers. With the size."""
    from PIL import Image

    if "compressedDepth" in form:
        raise Fault("a compressed depth image: name the topic of the raw one")
    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.format in ("JPEG", "PNG"):
                return image.format.lower(), image.size
    except OSError as error:
        raise Fault(f"a compressed image cannot be read: {error}") from None
    raise Fault(f"compressed images are of the format {form!r}; jpeg and png are read")


def depth_image(message):
    """Bytes and fields of a depth image, and its size."""
    known = {"16UC1": (2, "u16_mm"), "mono16": (2, "u16_mm"), "32FC1": (4, "f32_m")}
    encoding = message.get("encoding", message.get("format"))
    if encoding not in known:
        raise Fault(f"depth images are of the encoding {encoding!r}; 16UC1 (mm) and 32FC1 (m) are read: name the topic of the raw image")
    count, name = known[encoding]
    pixels = rows(message, data_of(message), count)
    if message["is_bigendian"]:
        values = array.array("H" if count == 2 else "I", pixels)
        values.byteswap()
        pixels = values.tobytes()
    return pixels, {"stamp": seconds(message), "encoding": name}, (message["width"], message["height"])


def rows(message, data, bytes_per_pixel):
    """The pixels without what pads each row."""
    width, height, step = message["width"], message["height"], message["step"]
    if not (1 <= width <= MOST_SIDE and 1 <= height <= MOST_SIDE):
        raise Fault(f"{width}×{height} is no size of an image")
    row = width * bytes_per_pixel
    if step < row or len(data) < step * height:
        raise Fault(f"the image has {len(data)} bytes, and {height} rows of {step} bytes with {width} pixels each are stated")
    if step == row:
        return data[: row * height]
    return b"".join(data[at : at + row] for at in range(0, step * height, step))


def lens(info, size, is_rectified):
    """The lens of images of this size: the raw image has K and D, the rectified one P and no distortion."""

    def field(name):  # ROS 1 has capitals
        return info[name] if name in info else info[name.upper()]

    if (info["width"], info["height"]) != size:
        raise Fault(f"it is for images of {info['width']}×{info['height']}, and they are {size[0]}×{size[1]}")
    roi = info.get("roi", {})
    if info.get("binning_x", 0) > 1 or info.get("binning_y", 0) > 1 or roi.get("x_offset", 0) or roi.get("y_offset", 0):
        raise Fault("it is for the whole sensor, and the images are binned or cut out of it")
    p, k = field("p"), field("k")
    fx, cx, fy, cy = (p[0], p[2], p[5], p[6]) if is_rectified else (k[0], k[2], k[4], k[5])
    if fx == 0:
        raise Fault("the camera is not calibrated: its matrix is zero")
    found = {"fx": fx, "fy": fy, "cx": cx, "cy": cy}
    bent = None if is_rectified else distortion(info["distortion_model"], list(field("d")))
    return {**found, "distortion": bent} if bent else found


def distortion(model, d):
    if not any(d):
        return None
    if model == "plumb_bob" and len(d) in (4, 5):
        return {"model": "brown_conrady", "coefficients": (d + [0.0])[:5]}
    # OpenCV writes up to 14; those after the eighth are for thin prisms and tilted sensors.
    if model == "rational_polynomial" and len(d) >= 8 and not any(d[8:]):
        return {"model": "rational", "coefficients": d[:8]}
    if model in ("equidistant", "fisheye") and len(d) == 4:
        return {"model": "fisheye", "coefficients": d}
    if model in ("plumb_bob", "rational_polynomial", "equidistant", "fisheye"):
        raise Fault(f"{model} with {len(d)} coefficients")
    raise Fault(f"the lens model {model!r} is not known; plumb_bob, rational_polynomial and equidistant are")


# ----------------------------------------------------------------------------------------------------------------- connection


class Bridge:
    """The connection to rosbridge. What comes over it waits in `incoming`: pairs of a topic and a message, of "status" and its
    text, of "topics" and their list, or of "close" and why. A reader that is slow slows down rosbridge."""

    speaker = "rosbridge"

    def __init__(self, url, fragment_size):
        self.url, self.fragment_size = url, fragment_size
        self.name = f"ROS through rosbridge at {url}"
        self.incoming = queue.Queue(maxsize=200)
        self.subscribed = set()
        self.pieces = collections.OrderedDict()

    def connect(self):
        import roslibpy

        unreachable = (
            "Start it with `ros2 launch rosbridge_server rosbridge_websocket_launch.xml` (ROS 1: `roslaunch rosbridge_server "
            "rosbridge_websocket.launch`)"
        )
        host, port = address(self.url)
        # The library keeps retrying, and does not report why it fails.
        try:
            socket.create_connection((host, port), PATIENCE_S).close()
        except OSError as error:
            raise Fault(f"no rosbridge answers at {self.url}: {error}. {unreachable}") from None
        self.message = roslibpy.Message
        self.ros = roslibpy.Ros(f"ws://[{host}]:{port}" if ":" in host else f"ws://{host}:{port}", transport="twisted")
        self.ros.factory.setProtocolOptions(
            maxMessagePayloadSize=MOST_BYTES,
            autoPingInterval=PING_S,
            autoPingTimeout=SILENCE_S,
            utf8validateIncoming=False,  # parsing the JSON does that, and faster
        )
        self.ros.factory.on_ready(self.listen)
        self.ros.on("close", lambda _: self.incoming.put(("close", "rosbridge closed the connection")))
        try:
            self.ros.run(timeout=PATIENCE_S)
        except roslibpy.core.RosTimeoutError:
            raise Fault(f"what listens at {self.url} does not answer as a rosbridge does for {PATIENCE_S} s. {unreachable}") from None

    def listen(self, protocol):
        protocol.register_message_handlers("fragment", lambda message: self.piece(protocol, message))
        # The library has no other way to receive rosbridge's messages about subscriptions.
        protocol._message_handlers["status"] = lambda message: self.incoming.put(("status", message))

    def send(self, message):
        self.ros.send_on_ready(self.message(message))

    def subscribe(self, topic, throttle_ms, queue_length):
        """Asks for a topic, or again for it. Without a type: rosbridge finds out which it is."""
        if topic not in self.subscribed:
            self.subscribed.add(topic)
            self.ros.on(topic, lambda message: self.incoming.put((topic, message)))
        request = {"op": "subscribe", "id": f"handeye:{topic}", "topic": topic, "compression": "none"}
        pieces = {"fragment_size": self.fragment_size} if self.fragment_size else {}
        self.send({**request, "throttle_rate": throttle_ms, "queue_length": queue_length, **pieces})

    def list_topics(self):
        import roslibpy

        def found(values):
            self.incoming.put(("topics", list(zip(values.get("topics", []), values.get("types", [])))))

        service = roslibpy.Service(self.ros, "/rosapi/topics", "rosapi/Topics")
        service.call(roslibpy.ServiceRequest(), found, lambda _: None)

    def piece(self, protocol, message):
        """Takes a piece of a message, and the whole message with the last. Four are put together at a time."""
        number, total = message["num"], message["total"]
        if not 0 <= number < total <= MOST_PIECES:
            raise ValueError(f"fragment {number} of {total}")
        key = (str(message["id"]), total)
        pieces = self.pieces.setdefault(key, {})
        pieces[number] = message["data"]
        if len(pieces) == total:
            del self.pieces[key]
            protocol.on_message("".join(pieces[i] for i in range(total)).encode())
        elif len(self.pieces) > 4 or sum(len(data) for data in pieces.values()) > MOST_BYTES:
            self.pieces.popitem(last=False)


def address(url):
    """Host and port."""
    example = "it looks like ws://192.168.0.7:9090"
    parts = urllib.parse.urlsplit(url)
    if parts.scheme == "wss":
        raise Fault(f"{url!r}: encrypted connections are not supported, a tunnel to its port is a way; {example}")
    if parts.scheme != "ws":
        raise Fault(f"{url!r} is no address of a rosbridge: it does not begin with ws://; {example}")
    try:
        host, port = parts.hostname, parts.port or PORT
    except ValueError as error:
        raise Fault(f"{url!r} is no address of a rosbridge: {error}; {example}") from None
    if not host:
        raise Fault(f"{url!r} is no address of a rosbridge: it names no host; {example}")
    return host, port


# --------------------------------------------------------------------------------------------------------------------- driver


class Rosbridge:
    """The driver. The bridge is what the messages of ROS come over."""

    def __init__(self, options, arm_joints, bridge):
        self.options, self.arm_joints, self.bridge = options, arm_joints, bridge
        self.tree = Tree()
        self.joints = Joints([joint["name"] for joint in arm_joints])
        self.frames = (options.base_frame, options.tip_frame) if options.base_frame else None
        self.heard = set()  # topics that have sent something
        self.topics, self.complaints, self.remarks = [], [], set()
        self.info, self.size, self.lens = None, None, None
        # Images and depth images that wait for the other.
        self.pictures, self.depths = collections.deque(maxlen=3), collections.deque(maxlen=3)
        self.last_s, self.sent_s, self.is_stale = -math.inf, time.monotonic(), False

    def subscriptions(self):
        """Topics, with the least time between two messages [ms] and the length of rosbridge's queue. tf is bounded by its queue
        alone: leaving out messages of one publisher leaves out another's links."""
        options = self.options
        # Image and depth, each throttled separately, would never be from one instant.
        throttle_ms = 0 if options.depth else 1000 // options.image_rate
        asked = [(TF, 0, 100), (TF_STATIC, 0, 100), (options.joints, 0, 100), (options.image, throttle_ms, 1)]
        asked += [(options.depth, throttle_ms, 1), (options.camera_info, 1000, 1)]
        return [subscription for subscription in asked if subscription[0]]

    def open(self, outlet):
        self.bridge.connect()
        for subscription in self.subscriptions():
            self.bridge.subscribe(*subscription)
        self.bridge.list_topics()
        self.wait_for_all(outlet)
        return self.hello()

    def wait_for_all(self, outlet):
        """Waits until all that was asked for has come, or says what has not."""
        lists = self.frames is None and not self.options.image
        begin = asked = time.monotonic()
        while lists or self.missing():
            now = time.monotonic()
            if lists and now - begin > LISTING_S:
                raise Fault(self.list_frames())
            if now - begin > FIRST_S:
                raise Fault(self.absent())
            if now - asked > AGAIN_S:
                asked = now
                for subscription in self.subscriptions():
                    if subscription[0] not in self.heard:
                        self.bridge.subscribe(*subscription)
            self.receive(outlet)

    def missing(self):
        """What has not come yet."""
        options = self.options
        if self.frames:
            try:
                self.tree.newest(*self.frames)
            except NoChain as error:
                return f"{error}. Its frames are:\n{self.tree.describe()}"
        if options.joints and self.joints.samples.last() is None:
            seen = ",".join(self.joints.seen)
            if not seen:
                return f"nothing comes on {options.joints}"
            if not self.joints.names:
                return f"which joints of {options.joints} are the arm's, from the base up? It has {seen}: give --joint-names, or --urdf"
            return f"{options.joints} has the joints {seen}, and not all of {','.join(self.joints.names)}"
        for topic in (options.image, options.depth, options.camera_info):
            if topic and topic not in self.heard:
                return f"nothing comes on {topic}"
        return None

    def absent(self):
        lines = [f"after {FIRST_S:.0f} s: {self.missing()}"]
        readable = [f"  {topic} ({kind})" for topic, kind in self.topics if kind.endswith(READ)][:50]
        lines += ["Topics that can be read:", *readable] if readable else []
        return "\n".join(lines + [f"{self.bridge.speaker} says: {complaint}" for complaint in self.complaints])

    def list_frames(self):
        frames = self.tree.describe()
        if not frames:
            return f"nothing comes on {TF} within {LISTING_S:.0f} s: is robot_state_publisher running? Give --image for a camera alone"
        return (
            "which frames are the robot's base and its tip? Give --base-frame and --tip-frame (often base_link and tool0). tf has:\n"
            + frames
        )

    def hello(self):
        options = self.options
        hello = {"name": self.bridge.name, "clock": "ROS"}
        abilities = {"state": self.frames, "joints": options.joints, "image": options.image, "depth": options.depth}
        hello["can"] = [ability for ability, topic in abilities.items() if topic]
        if options.joints:
            hello["joints"] = self.arm_joints
            if options.urdf:
                # The workbench reads the file itself, wherever it was started.
                path = os.path.realpath(options.urdf)
                hello["arm"] = {"urdf": path, "base_link": options.base_frame, "tip_link": options.tip_frame}
        if options.image:
            hello["camera"] = {"width": self.size[0], "height": self.size[1]}
            if options.camera_info:
                self.lens = self.of_topic(options.camera_info, lambda: lens(self.info, self.size, options.rectified))
                hello["camera"]["intrinsics"] = self.lens
        return hello

    def run(self, outlet):
        while not outlet.ended.is_set():
            self.receive(outlet)
            self.publish_arm(outlet)

    def receive(self, outlet):
        """Takes what comes next, if something does within a moment."""
        try:
            topic, message = self.bridge.incoming.get(timeout=TICK_S)
        except queue.Empty:
            return
        if topic == "close":
            raise Fault(message)
        if topic == "topics":
            self.topics = message
        elif topic == "status":
            text = str(message.get("msg"))
            if len(self.complaints) < 10 and text not in self.complaints:
                self.complaints.append(text)
            outlet.log("error" if message.get("level") == "error" else "info", f"{self.bridge.speaker} says: {text}")
        else:
            self.heard.add(topic)
            self.of_topic(topic, lambda: self.take(topic, message, outlet))

    @staticmethod
    def of_topic(topic, work):
        """Has what is wrong with a message name its topic."""
        try:
            return work()
        except Fault as fault:
            raise Fault(f"{topic}: {fault}") from None
        except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
            raise Fault(f"{topic}: its messages are not of the type that is read from it: {error!r}") from None

    def take(self, topic, message, outlet):
        options = self.options
        if topic in (TF, TF_STATIC):
            self.take_transforms(message["transforms"], topic == TF_STATIC, outlet)
        elif topic == options.joints:
            self.joints.take(message)
            outlet.heard(seconds(message))
        elif topic == options.camera_info:
            self.info = message
        elif topic == options.image:
            data, fields = picture(message)
            self.check_stamp(fields)
            size = (fields["width"], fields["height"])
            if self.size not in (None, size):
                raise Fault(f"images were {self.size[0]}×{self.size[1]} and are {size[0]}×{size[1]} now")
            self.size = size
            self.pictures.append((data, fields))
            self.publish_image(outlet)
        elif topic == options.depth:
            data, fields, size = depth_image(message)
            self.check_stamp(fields)
            if self.size not in (None, size):
                raise Fault(
                    f"depth images are {size[0]}×{size[1]} and images {self.size[0]}×{self.size[1]}: name the topic of depth that is "
                    "aligned to the image"
                )
            self.depths.append((data, fields))
            self.publish_image(outlet)

    @staticmethod
    def check_stamp(fields):
        if fields["stamp"] <= 0:
            raise Fault(
                "its messages have no stamp (header.stamp is zero), so nothing says where the arm was then: have the camera's node "
                "set it"
            )

    def take_transforms(self, transforms, is_static, outlet):
        newest = -math.inf
        for link in transforms:
            parent, child, stamp = link["header"]["frame_id"], link["child_frame_id"], seconds(link)
            t, q = link["transform"]["translation"], link["transform"]["rotation"]
            translation, rotation = (t["x"], t["y"], t["z"]), (q["x"], q["y"], q["z"], q["w"])
            norm = math.hypot(*rotation)
            if not abs(norm - 1) < UNIT_TOLERANCE:
                self.remark(outlet, f'tf: the quaternion from "{parent}" to "{child}" is not a rotation; it is not used')
                continue
            rotation = tuple(value / norm for value in rotation)
            if not self.tree.insert(parent, child, stamp, (translation, rotation), is_static):
                self.remark(outlet, f"tf has more than {MOST_FRAMES} frames; those that came last are not used")
            newest = max(newest, stamp)
        if newest > -math.inf and not is_static:
            outlet.heard(newest)

    def remark(self, outlet, text):
        if len(self.remarks) < 20 and text not in self.remarks:
            self.remarks.add(text)
            outlet.log("warn", text)

    def publish_image(self, outlet):
        """The newest image, with the depth of its instant where that is asked for."""
        depth = None
        if self.options.depth:
            pairs = (
                (i, j)
                for i, (_, image) in reversed(list(enumerate(self.pictures)))
                for j, (_, fields) in enumerate(self.depths)
                if abs(fields["stamp"] - image["stamp"]) <= ONE_INSTANT_S
            )
            pair = next(pairs, None)
            if pair is None:
                return
            i, j = pair
            depth = self.depths[j]
            data, fields = self.pictures[i]
            self.pictures = collections.deque(list(self.pictures)[i + 1 :], maxlen=3)
            self.depths = collections.deque(list(self.depths)[j + 1 :], maxlen=3)
        else:
            data, fields = self.pictures.pop()
        outlet.heard(fields["stamp"])
        outlet.image(data, depth, **fields)

    def publish_arm(self, outlet):
        """The newest instant at which the whole chain, and the joints where they are asked for, are known."""
        if self.frames is None:
            return
        limit = self.joints.samples.last() if self.options.joints else math.inf
        try:
            stamp, (translation, rotation) = self.tree.newest(*self.frames, limit)
        except NoChain:
            return
        now = time.monotonic()
        if stamp is None:
            stamp = limit
            if stamp == math.inf:
                # Nothing moves and nothing is stamped: it is valid now.
                if now - self.sent_s < TICK_S:
                    return
                stamp = outlet.device_time()
        if stamp < self.last_s - RESET_S:
            raise Fault("the clock of ROS went back: was a recording played again?")
        if stamp - self.last_s < CLOSEST_S:
            if not self.is_stale and now - self.sent_s > STALE_S:
                self.is_stale = True
                outlet.log("warn", f"tf has nothing new of {self.frames[1]} in {self.frames[0]} for {STALE_S:.0f} s")
            return
        joints = self.joints.samples.at(stamp, line) if self.options.joints else None
        if self.options.joints and joints is None:
            return
        outlet.state(stamp, joints_rad=joints, base_from_tip=pose(translation, rotation))
        self.last_s, self.sent_s, self.is_stale = stamp, now, False


def main():
    options = parser(__doc__)
    add = options.add_argument
    add("--url", default=f"ws://127.0.0.1:{PORT}", help="address of the rosbridge")
    add("--base-frame", metavar="FRAME", help="frame of tf in which poses are stated, often base_link; without this and --image, the frames are listed")
    add("--tip-frame", metavar="FRAME", help="frame of tf of the tip, often tool0")
    add("--image", metavar="TOPIC", help="topic of images, raw or compressed")
    add("--camera-info", metavar="TOPIC", help="topic of sensor_msgs/CameraInfo, where the lens is calibrated")
    add("--rectified", action="store_true", help="the images are rectified: their lens is the projection matrix, without distortion")
    add("--depth", metavar="TOPIC", help="topic of raw depth images, aligned to the images")
    add("--joints", metavar="TOPIC", help="topic of sensor_msgs/JointState; which joints, say --joint-names or --urdf")
    add("--joint-names", metavar="NAME,…", help="names of the arm's joints from the base up, all revolute")
    add("--urdf", metavar="FILE", help="the arm's URDF: its joints between the base frame and the tip frame")
    add("--image-rate", metavar="HZ", type=within(1, 100, int), default=10, help="images a second at most, 10")
    add(
        "--fragment-size",
        metavar="BYTES",
        type=within(1000, MOST_BYTES, int),
        help="have rosbridge cut longer messages into pieces, where a proxy between does not let them through",
    )
    chosen, joints = chosen_by(options)
    try:
        address(chosen.url)
    except Fault as fault:
        options.error(str(fault))
    serve(Rosbridge(chosen, joints, Bridge(chosen.url, chosen.fragment_size)))


def chosen_by(options):
    """The options that were given, where they belong together, and the arm's joints."""
    chosen = options.parse_args()
    for option, needs in (
        ("base_frame", "tip_frame"), ("tip_frame", "base_frame"), ("camera_info", "image"), ("depth", "image"),
        ("rectified", "camera_info"), ("joints", "base_frame"), ("joint_names", "joints"), ("urdf", "joints"),
    ):  # fmt: skip
        if getattr(chosen, option) and not getattr(chosen, needs):
            options.error(f"--{option} needs --{needs}".replace("_", "-"))
    if chosen.urdf and chosen.joint_names:
        options.error("the joints are those of --joint-names or of --urdf, not both")
    if chosen.camera_info and "rect" in chosen.image and not chosen.rectified:
        options.error(
            f"{chosen.image} looks like rectified images, whose lens is the projection matrix of camera info without distortion: "
            "give --rectified if they are, or name the raw images"
        )
    try:
        joints = [{"name": name, "kind": "revolute"} for name in (chosen.joint_names or "").split(",") if name]
        if chosen.urdf:
            joints = joints_of_urdf(chosen.urdf, chosen.base_frame, chosen.tip_frame)
    except Fault as fault:
        options.error(str(fault))
    return chosen, joints


if __name__ == "__main__":
    main()
