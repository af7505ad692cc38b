"""The driver protocol of Handeye Workbench (docs/drivers.md), as the drivers beside this file speak it.

A driver is an object with

    open(outlet)    connects, within ten seconds, and returns what the driver's `hello` says
    run(outlet)     publishes states and images until `outlet.ended` is set

and is handed to `serve`, which answers the workbench meanwhile. Such a driver only reads: a request to move is refused. One that
moves the arm has as well

    command(message, outlet)    takes a message `arm`, `move` or `stop`, in the thread that reads, and sees to its answer

and brakes when nothing was heard for a second (`outlet.last_message_s`). Copy this file together with a driver; it needs nothing
but Python.
"""

import argparse
import collections
import json
import math
import os
import shutil
import sys
import textwrap
import threading
import time
import traceback

PROTOCOL = 1
VERSION = "1.0"
LONGEST_LINE = 65_536
# A driver that reads nothing for this long [s] was started by a user, who has to know what it waits for.
LONELY_S = 1.0
WAITING = (
    "this program is a driver and waits for `hello` on its standard input, which the workbench sends that starts it: name this "
    'command under Connect, Driver, or try it with `handeye driver test "COMMAND"`, in quotes'
)
KNOWN = ("hello", "ping", "next_image", "arm", "move", "stop", "bye")


class Fault(Exception):
    """Why a driver cannot go on, in words for the user. The workbench starts it again."""


class DeviceClock:
    """What another computer's clock shows, from the stamps of what it sends.

    A message arrives some time after it was stamped, so the fastest one of late is nearest to the truth.
    """

    # How long a message counts [s]: two clocks that drift apart by 1 part in 10 000 stay within 3 ms.
    WINDOW_S = 30.0
    # One value is kept for this long [s].
    BUCKET_S = 1.0
    # How fast the shown clock follows the estimate [s/s]. Faster than 1e-4, the workbench would take it for a clock that was set.
    SLEW = 5e-5
    # A larger difference [s] is shown at once: the clock was set, or the first messages were very late.
    STEP_S = 0.05

    def __init__(self):
        self.buckets = collections.deque()  # [begin, least of arrival - stamp], oldest first
        self.shown = None  # when it was last read, and by how much the own clock was shown to lead

    def heard(self, arrival_s, stamp_s):
        lead = arrival_s - stamp_s
        if self.buckets and arrival_s - self.buckets[-1][0] < self.BUCKET_S:
            self.buckets[-1][1] = min(self.buckets[-1][1], lead)
        else:
            self.buckets.append([arrival_s, lead])
        while arrival_s - self.buckets[0][0] > self.WINDOW_S:
            self.buckets.popleft()

    def at(self, own_s):
        """The device's time at this time of the own clock: that itself as long as nothing was heard."""
        if not self.buckets:
            return own_s
        lead = min(least for _, least in self.buckets)
        if self.shown is not None:
            last_s, shown = self.shown
            if abs(lead - shown) < self.STEP_S:
                most = self.SLEW * max(own_s - last_s, 0.0)
                lead = shown + min(max(lead - shown, -most), most)
        self.shown = (own_s, lead)
        return own_s - lead


class Outlet:
    """Where a driver's states and images go. It holds one image."""

    def __init__(self, output):
        self.output = output
        self.lock = threading.RLock()
        self.clock = DeviceClock()
        self.ended = threading.Event()
        self.greeted = False
        # When the workbench last sent anything, by `own_time`.
        self.last_message_s = self.own_time()
        self.wanted = None
        self.newest = None

    @staticmethod
    def own_time():
        """Seconds of a steady clock of this computer."""
        return time.monotonic()

    def heard(self, stamp):
        """Something with this stamp of the device's clock has just arrived. A driver without it stamps with `own_time`."""
        with self.lock:
            self.clock.heard(self.own_time(), stamp)

    def device_time(self):
        with self.lock:
            return self.clock.at(self.own_time())

    def send(self, message, data=b""):
        line = json.dumps(message, allow_nan=False, ensure_ascii=False).encode() + b"\n"
        with self.lock:  # a message and its bytes stay together
            try:
                self.output.write(line)
                self.output.write(data)
                self.output.flush()
            except OSError:  # the reader is gone
                self.ended.set()

    def state(self, stamp, **fields):
        """Where the robot is. Fields that are None are left out."""
        known = {name: value for name, value in fields.items() if value is not None}
        self.send({"type": "state", "stamp": stamp, **known})

    def image(self, data, depth=None, **fields):
        """A new image, with the fields of the message `image`; `depth` is the bytes and fields of its depth image. It answers
        the request that waits for one, or the next."""
        with self.lock:
            self.newest = (fields, data, depth)
            self.answer()

    def want(self, request):
        with self.lock:
            self.wanted = request
            self.answer()

    def answer(self):
        if self.wanted is None or self.newest is None:
            return
        request, (fields, data, depth) = self.wanted, self.newest
        after = request.get("after")
        if after is not None and fields["stamp"] <= after or request.get("depth") and depth is None:
            return
        # Its stamp is not greater than itself, so it would answer no other request.
        self.wanted = self.newest = None
        self.send({"type": "image", "id": request["id"], **fields, "bytes": len(data)}, data)
        if request.get("depth"):
            depth_data, depth_fields = depth
            size = {"width": fields["width"], "height": fields["height"]}
            self.send({"type": "depth", "id": request["id"], **size, **depth_fields, "bytes": len(depth_data)}, depth_data)

    def log(self, level, text):
        """A line for the window's log; `level` is debug, info, warn or error."""
        with self.lock:
            if self.greeted:
                self.send({"type": "log", "level": level, "text": text})
            else:
                print(text, file=sys.stderr, flush=True)


def run_device(device, outlet):
    """Everything that the device does, in a thread: `hello` within ten seconds, then states and images."""
    try:
        hello = device.open(outlet)
        with outlet.lock:
            outlet.send({"type": "hello", "protocol": PROTOCOL, "version": VERSION, **hello})
            outlet.greeted = True
        device.run(outlet)
    except Fault as fault:
        fail(outlet, str(fault))
    except Exception as error:
        traceback.print_exc()
        fail(outlet, f"the program of this driver has a fault ({error!r}); standard error says where")
    finish(0)


def fail(outlet, text):
    outlet.send({"type": "error", "text": text})
    print(f"error: {text}", file=sys.stderr)
    finish(1)


def finish(code):
    """Ends at once: libraries have threads that would go on."""
    sys.stderr.flush()
    os._exit(code)


def answer(message, device, outlet):
    """Answers a message. False when it was the last."""
    kind, identity = message["type"], {"id": message.get("id")}
    if kind == "hello":
        if message["protocol"] != PROTOCOL:
            fail(outlet, f"the workbench speaks version {message['protocol']} of the protocol, this driver {PROTOCOL}")
        threading.Thread(target=run_device, args=(device, outlet), daemon=True).start()
    elif kind == "ping":
        outlet.send({"type": "pong", **identity, "stamp": outlet.device_time()})
    elif kind == "next_image":
        outlet.want(message)
    elif kind in ("arm", "move", "stop") and hasattr(device, "command"):
        device.command(message, outlet)
    elif kind == "move" or kind == "arm" and message["on"]:
        outlet.send({"type": "refused", **identity, "why": "this driver only reads: it cannot move the arm"})
    elif kind in ("arm", "stop"):
        outlet.send({"type": "done", **identity})
    return kind != "bye"


def hear(line, device, outlet):
    """Takes a line of the workbench. A message of an unknown type is nothing; one that cannot be read is worth a line."""
    kind = None
    outlet.last_message_s = outlet.own_time()
    try:
        message = json.loads(line)
        kind = message["type"]
        return answer(message, device, outlet)
    except (ValueError, KeyError, TypeError) as error:
        if kind is None or kind in KNOWN:
            outlet.log("warn", f"a message of the workbench cannot be read: {error!r}")
        return True


def serve(device):
    """Speaks for a device until the workbench says `bye` or closes its end, and then ends the program."""
    # Standard output is for messages only: output of libraries goes to standard error, and so to the window's log.
    messages = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    outlet = Outlet(messages)
    lonely = threading.Timer(LONELY_S, outlet.log, ("warn", WAITING))
    lonely.daemon = True
    lonely.start()
    while True:
        line = sys.stdin.buffer.readline(LONGEST_LINE)
        lonely.cancel()
        if not line.endswith(b"\n") or not hear(line, device, outlet) or outlet.ended.is_set():
            break
    outlet.ended.set()
    finish(0)


def parser(documentation):
    """Options of a driver, under the name that it was started with. Of its documentation, what is indented are examples."""
    width = min(shutil.get_terminal_size().columns, 100) - 2
    paragraphs = documentation.strip("\n").split("\n\n")
    examples = [textwrap.indent(textwrap.dedent(part), "  ") for part in paragraphs if part.startswith("    ")]
    words = [textwrap.fill(part, width) for part in paragraphs if not part.startswith("    ")]
    name = os.environ.get("HANDEYE_DRIVER")  # set if the workbench's program starts it
    options = argparse.ArgumentParser(
        prog=name,
        description="\n\n".join(words),
        epilog="\n".join(["Examples:", *examples]),
        formatter_class=lambda prog: argparse.RawDescriptionHelpFormatter(prog, width=width),
        allow_abbrev=False,
    )
    if name:
        # That program removes them from the options.
        help = "the Python to run this with, which has its packages, in place of an environment that is made once"
        options.add_argument("--python", metavar="PATH", help=help)
        options.add_argument("-q", "--quiet", action="store_true", help="print results and errors only")
    return options


def within(least, most, number=float):
    """A type of numbers for options."""

    def read(text):
        value = number(text)
        if not least <= value <= most:
            raise argparse.ArgumentTypeError(f"{text} is not within {least} to {most}")
        return value

    return read


def size(text):
    """Width and height in pixels, such as 1280x720, for options."""
    parts = text.replace("×", "x").split("x")
    if len(parts) != 2 or not all(part.isdecimal() and int(part) > 0 for part in parts):
        raise argparse.ArgumentTypeError("width and height in pixels, such as 1280x720")
    return int(parts[0]), int(parts[1])


def times(a, b):
    """The product of two quaternions x, y, z, w."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def conjugate(q):
    return (-q[0], -q[1], -q[2], q[3])


def turned(q, vector):
    """A vector turned by a unit quaternion."""
    return times(times(q, (*vector, 0.0)), conjugate(q))[:3]


def quaternion(vector):
    """The quaternion of a rotation vector, axis times angle in radians."""
    angle = math.sqrt(sum(v * v for v in vector))
    share = math.sin(angle / 2) / angle if angle > 1e-12 else 0.5
    return (*(share * v for v in vector), math.cos(angle / 2))


def pose(translation_m, rotation_xyzw):
    """A transform as messages have it."""
    return {"translation_m": list(translation_m), "rotation_xyzw": list(rotation_xyzw)}
