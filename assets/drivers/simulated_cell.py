"""A simulated robot and camera before a chessboard, as a driver: what pybullet_cell.py and mujoco_cell.py have in common.

It moves the arm, keeps to the rules of motion (docs/drivers.md), places camera and board, and has the camera's images rendered
in a process of their own, so that states go on meanwhile. A simulator is a class whose object has

    name                        of the cell, for the window
    arm                         which chain the joints are, as `hello` has it
    joints                      as `hello` has them, from the base up
    fastest                     the highest speed of each joint [rad/s, m/s]
    start                       joint values at which the board is in view
    camera                      None, or the pose of the model's own camera in the tip, or in the base where it stands beside the
                                arm, and its lens
    base_from_tip(joints)       where the tip is; a pose is a pair (translation_m, rotation_xyzw)
    furnish(options)            adds the board, and prepares to render; called in the process that renders only
    render(joints, base_from_camera, base_from_target, lens, with_depths)
                                colours (rows × columns × 3 or more, bytes) of what is at the centres of the pixels, and its depths
                                along the optical axis (rows × columns, metres)

and is made of the options. Arms are put where they are to be: nothing of their dynamics is simulated.
"""

import argparse
import importlib
import json
import math
import multiprocessing
import sys
import threading
import time
import traceback

from handeye_driver import Fault, conjugate, pose, quaternion, serve, size, times, turned, within

# States a second.
RATE_HZ = 50
# No step of the motion is longer [s]: after a pause of the whole program the arm goes on from where it was.
LONGEST_STEP_S = 0.05
# How fast joints gain and lose speed [rad/s², m/s²]: with the highest speeds below, an arm brakes within 0.6 s.
RISE = {"revolute": 4.0, "prismatic": 1.0}
# Joints are no faster [rad/s, m/s], whatever their model allows: that of the iiwa has 573°/s.
FASTEST = {"revolute": 2.2, "prismatic": 0.5}
# Without a message of the workbench for so long [s] the arm brakes.
SILENCE_S = 1.0
# Shortest time between two images [s].
BETWEEN_IMAGES_S = 0.1
# No more is rendered for an image after this time [s]: the workbench waits for 5 s.
RENDER_S = 2.5
# Focal length over the width of the image: 56° wide.
FOCAL = 0.9375
# What is nearer or farther is not rendered, and has no depth [m].
NEAR_M, FAR_M = 0.03, 5.0
# The margin of the board's sheet, in squares.
MARGIN = 1
# Grey of the dark and the light squares, 0 to 1.
DARK, LIGHT = 0.06, 0.92
# The board lies so far above the table [m].
SHEET_M = 1e-3

# Where the camera is on the tip, if the model has none: beside the flange, looking along its z, and not quite in line with it.
TIP_FROM_CAMERA = ((0.075, 0.01, 0.045), times(quaternion((0, 0, math.pi / 2)), quaternion((0.04, -0.03, 0.02))))
# Where the middle of a board on the tip is, its printed side away from the arm. There is room for a gripper behind it.
TIP_FROM_BOARD = ((0.01, -0.015, 0.12), times(quaternion((math.pi, 0, 0)), quaternion((0.05, 0.03, 0.2))))
# How a camera beside the arm sees the board at the start: turned by this, and as wide as this share of the image.
CAMERA_FROM_BOARD, SHARE = quaternion((0.25, -0.2, 0.1)), 0.3
# A camera beside the arm is no lower than this over the plane z = 0 of the base [m].
CLEAR_M = 0.05
# The camera on the arm sees the board on the table from no nearer or farther at the start [m].
START_M = (0.1, 1.5)


# ----------------------------------------------------------------------------------------------------------------------- poses


def compose(a, b):
    return tuple(x + y for x, y in zip(a[0], turned(a[1], b[0]))), unit(times(a[1], b[1]))


def inverse(a):
    q = conjugate(a[1])
    return tuple(-x for x in turned(q, a[0])), q


def unit(q):
    norm = math.sqrt(sum(x * x for x in q))
    return tuple(x / norm for x in q)


def transformed(a, point):
    return tuple(x + y for x, y in zip(a[0], turned(a[1], point)))


# ----------------------------------------------------------------------------------------------------------------------- board


class Board:
    """A chessboard by its inner corners. Its frame begins at the first of them, x along columns, y along rows, z into the board."""

    def __init__(self, columns, rows, square_m):
        self.columns, self.rows, self.square_m = columns, rows, square_m
        # Where the middle is.
        self.middle = ((columns - 1) * square_m / 2, (rows - 1) * square_m / 2, 0.0)

    @classmethod
    def of_text(cls, text):
        """Inner corners and square in mm, such as 10x7x15, for options."""
        try:
            columns, rows, square_mm = text.replace("×", "x").split("x")
            board = cls(int(columns), int(rows), float(square_mm) / 1000)
        except ValueError:
            board = None
        if board is None or not (2 <= board.columns <= 100 and 2 <= board.rows <= 100 and 1e-3 <= board.square_m <= 1):
            raise argparse.ArgumentTypeError("inner corners along columns and rows, and the square in mm, such as 10x7x15")
        return board

    def rectangles(self):
        """What is printed: (x, y) of two opposite corners of each rectangle, and whether it is dark.

        The squares are surfaces of their own, not pixels of a texture: their edges are then exactly where they should be, at
        every distance and angle, whatever a renderer does to textures.
        """
        edge = self.square_m
        for row in range(self.rows + 1):
            for column in range(self.columns + 1):
                x, y = (column - 1) * edge, (row - 1) * edge
                # The square between the first four corners is dark.
                yield (x, y), (x + edge, y + edge), (column + row) % 2 == 0
        left, right, near, far = -edge, self.columns * edge, -edge, self.rows * edge
        margin = MARGIN * edge
        yield (left - margin, near - margin), (right + margin, near), False
        yield (left - margin, far), (right + margin, far + margin), False
        yield (left - margin, near), (left, far), False
        yield (right, near), (right + margin, far), False


class Layout:
    """Where camera and board are: the one on the tip, the other in the base."""

    def __init__(self, options, simulator):
        self.is_eye_to_hand = options.eye_to_hand
        width, height = options.size
        mount_from_camera, self.lens = simulator.camera or (None, lens(width, height, FOCAL * width, FOCAL * width))
        base_from_tip = simulator.base_from_tip(simulator.start)
        middle = options.board.middle
        if self.is_eye_to_hand:
            tip_from_board = compose(TIP_FROM_BOARD, (tuple(-x for x in middle), (0, 0, 0, 1)))
            away = self.lens["fx"] * 2 * middle[0] / (SHARE * width)
            camera_from_board = ((0, 0, away), CAMERA_FROM_BOARD)
            base_from_board = compose(base_from_tip, TIP_FROM_BOARD)
            self.mount_from_camera = mount_from_camera or compose(base_from_board, inverse(camera_from_board))
            if mount_from_camera is None and self.mount_from_camera[0][2] < CLEAR_M:
                raise Fault(
                    "at its start the arm turns the board down, and the camera would be in the table: give joint values with "
                    "--start at which the board is turned to the side"
                )
            self.anchor_from_target = tip_from_board
        else:
            self.mount_from_camera = mount_from_camera or TIP_FROM_CAMERA
            self.anchor_from_target = on_the_table(compose(base_from_tip, self.mount_from_camera), middle)
        self.check(base_from_tip, options.board)

    def places(self, base_from_tip):
        """base_from_camera and base_from_target."""
        if self.is_eye_to_hand:
            return self.mount_from_camera, compose(base_from_tip, self.anchor_from_target)
        return compose(base_from_tip, self.mount_from_camera), self.anchor_from_target

    def check(self, base_from_tip, board):
        """The workbench begins with the whole board in view."""
        base_from_camera, base_from_target = self.places(base_from_tip)
        camera_from_target = compose(inverse(base_from_camera), base_from_target)
        edge = board.square_m
        for x, y in ((x, y) for x in (-edge, board.columns * edge) for y in (-edge, board.rows * edge)):
            px, py, pz = transformed(camera_from_target, (x, y, 0))
            u = self.lens["fx"] * px / pz + self.lens["cx"] if pz > 0 else -1
            v = self.lens["fy"] * py / pz + self.lens["cy"] if pz > 0 else -1
            if not (0 <= u <= self.lens["width"] - 1 and 0 <= v <= self.lens["height"] - 1):
                raise Fault(
                    "at its start the camera does not see the whole board: give other joint values with --start, or a smaller "
                    "board with --board"
                )

    def truth(self):
        camera, target = pose(*self.mount_from_camera), pose(*self.anchor_from_target)
        return {"mount_from_camera": camera, "anchor_from_target": target, "intrinsics": self.lens}


def on_the_table(base_from_camera, middle):
    """base_from_target of a board that lies on the plane z = 0 with its middle where the camera looks, and upright for it."""
    origin, (dx, dy, dz) = base_from_camera[0], turned(base_from_camera[1], (0, 0, 1))
    away = (SHEET_M - origin[2]) / dz if dz < -0.1 else math.inf
    if not START_M[0] <= away <= START_M[1]:
        raise Fault(
            "at its start the camera does not look at the table, the plane z = 0 of the base, from a distance of "
            f"{START_M[0]} to {START_M[1]} m: give joint values with --start at which it does"
        )
    right = turned(base_from_camera[1], (1, 0, 0))
    yaw = quaternion((0, 0, math.atan2(right[1], right[0])))
    face_up = times(yaw, quaternion((math.pi, 0, 0)))
    centre = (origin[0] + away * dx, origin[1] + away * dy, SHEET_M)
    return tuple(c - x for c, x in zip(centre, turned(face_up, middle))), face_up


# ---------------------------------------------------------------------------------------------------------------------- images


def lens(width, height, fx, fy):
    """The lens of a rendered image: without distortion, its axis through the middle.

    The middle of the image is at ((w - 1) / 2, (h - 1) / 2) where pixel (0, 0) is the centre of the first one, as the workbench
    counts. OpenGL counts from the corner of that pixel, by which the same place is (w / 2, h / 2).
    """
    return {"fx": fx, "fy": fy, "cx": (width - 1) / 2, "cy": (height - 1) / 2, "width": width, "height": height}


def shifts(samples):
    """Places in a pixel, x and y from its centre, that are spread evenly over it: no two in one column or row. They come in pairs
    on either side of the centre, so that the first of them alone do not shift the image either."""
    golden = (math.sqrt(5) - 1) / 2
    begin = 1.0 if samples % 2 else 0.5
    right = [((begin + i) / samples, (golden * (begin + i) + 0.5) % 1.0 - 0.5) for i in range(samples // 2)]
    # The first of them are spread as well.
    order = sorted(range(len(right)), key=lambda i: golden * i % 1.0)
    pairs = [(right[i], (-right[i][0], -right[i][1])) for i in order]
    return [((0.0, 0.0),), *pairs] if samples % 2 else pairs


def picture(cell, where, of_lens, samples):
    """An image, as the bytes of rgb8 and f32_m, and of how many it is the mean.

    A pixel of a real camera sees the mean over its area. One that is rendered once sees what is at its centre: the edges of the
    board are then steps that move by whole pixels, and corners are off by tenths of a pixel, most of all where edges are along
    rows and columns. So the image is the mean of several, each for a camera whose lens is shifted by a part of a pixel. Corners
    are then off by 0.05 px and less with 8 of them, by 0.01 px with 16 and by 0.004 px with 64.

    A depth is that of what is at the centre of the pixel; 0, not measured, where that is too near or too far.
    """
    import numpy as np

    until_s = time.monotonic() + RENDER_S
    _, depths = cell.render(*where, of_lens, True)
    sums, count = np.zeros((*depths.shape, 3), np.uint32), 0
    for pair in shifts(samples):
        for x, y in pair:
            # What is at (u + x, v + y) comes to (u, v).
            colours, _ = cell.render(*where, {**of_lens, "cx": of_lens["cx"] - x, "cy": of_lens["cy"] - y}, False)
            sums += colours[..., :3]
            count += 1
        if time.monotonic() > until_s:
            break
    rgb = ((sums + count // 2) // count).astype(np.uint8)
    depths = np.where((depths > NEAR_M) & (depths < 0.999 * FAR_M), depths, 0)  # the farthest is the background
    return rgb.tobytes(), depths.astype("<f4").tobytes(), count


def render_for(pipe, simulator, options, of_lens):
    """The process that renders: it answers joint values and places with an image, or with why there is none."""
    try:
        cell = simulator(options)
        cell.furnish(options)
        fewest = options.samples
        while True:
            where, samples = pipe.recv()
            colours, depths, count = picture(cell, where, of_lens, samples)
            pipe.send((None, (colours, depths)))
            if samples == options.samples and count < fewest:
                fewest = count
                print(f"this computer is slow: an image is the mean of {count} in place of {samples}, less exact", file=sys.stderr)
    except (EOFError, OSError, KeyboardInterrupt):  # the driver has ended
        pass
    except Fault as fault:
        pipe.send((str(fault), None))
    except Exception as error:
        traceback.print_exc()
        pipe.send((f"rendering failed ({error!r}); standard error says where", None))


# ---------------------------------------------------------------------------------------------------------------------- motion


class Motion:
    """A straight line in joint space, on which all joints begin and end together and no joint is faster than it may be."""

    def __init__(self, identity, begin, goal, fastest, rise):
        self.identity, self.begin, self.goal = identity, begin, goal
        ways = [abs(b - a) for a, b in zip(begin, goal)]
        # Of the whole way, and a second.
        self.pace_most = min((f / way for f, way in zip(fastest, ways) if way > 0), default=math.inf)
        self.rise = min((r / way for r, way in zip(rise, ways) if way > 0), default=math.inf)
        self.part, self.pace = 0.0, 0.0
        # Why it brakes.
        self.why = None

    def step(self, seconds):
        """Goes on; gives the joint values, and whether it has ended."""
        if self.begin == self.goal:
            return self.goal, True
        before = self.pace
        if self.why is None:
            # The last is the speed at which braking ends at the goal.
            self.pace = min(before + self.rise * seconds, self.pace_most, math.sqrt(2 * self.rise * (1 - self.part)))
        else:
            self.pace = max(before - self.rise * seconds, 0.0)
        step = 0.5 * (before + self.pace) * seconds
        if self.part + step >= 1 - 1e-4 or self.why is None and 1 - self.part - step <= self.pace * seconds:
            return self.goal, True
        self.part += step
        return [a + self.part * (b - a) for a, b in zip(self.begin, self.goal)], self.why is not None and self.pace == 0


# ---------------------------------------------------------------------------------------------------------------------- driver


class SimulatedCell:
    def __init__(self, simulator, options):
        self.simulator, self.options = simulator, options
        self.cell = self.layout = self.camera = None
        self.at, self.motion, self.is_armed = [], None, False
        self.rise = self.last_step_s = None
        # When the workbench was last heard, and for how long of this program's time it was not since.
        self.heard_s, self.silence_s = None, 0.0
        # Requests that are answered once the arm is at rest.
        self.at_rest = []
        # What ended the thread of the camera.
        self.trouble = None

    def open(self, outlet):
        options = self.options
        self.cell = self.simulator(options)
        self.layout = Layout(options, self.cell)
        self.at = list(self.cell.start)
        self.rise = [RISE[joint["kind"]] for joint in self.cell.joints]
        if options.truth:
            try:
                with open(options.truth, "w", encoding="utf-8") as file:
                    json.dump(self.layout.truth(), file, indent=1)
            except OSError as error:
                raise Fault(f"{options.truth} cannot be written: {error.strerror}") from None
        context = multiprocessing.get_context("spawn")
        self.camera, other = context.Pipe()
        arguments = (other, self.simulator, options, self.layout.lens)
        context.Process(target=render_for, args=arguments, daemon=True).start()
        other.close()
        width, height = options.size
        intrinsics = {name: self.layout.lens[name] for name in ("fx", "fy", "cx", "cy")}
        return {
            "name": self.cell.name,
            "clock": "monotonic",
            "can": ["state", "joints", "image", "depth", "move_joints"],
            "joints": self.cell.joints,
            "arm": self.cell.arm,
            "camera": {"width": width, "height": height, "intrinsics": intrinsics},
            "depth_limits_m": [NEAR_M, FAR_M],
        }

    def report(self, outlet):
        """Says where the arm is; the stamp, and the pose of the tip. With the outlet's lock: stamps never go back."""
        stamp, base_from_tip = outlet.own_time(), self.cell.base_from_tip(self.at)
        tip = pose(*base_from_tip)
        # The chain of joints ends at the tip, which the pose of the flange says.
        outlet.state(stamp, joints_rad=self.at, base_from_tip=tip, base_from_flange=tip, moving=self.motion is not None)
        return stamp, base_from_tip

    def run(self, outlet):
        threading.Thread(target=self.look, args=(outlet,), daemon=True).start()
        self.last_step_s = outlet.own_time()
        while not outlet.ended.is_set():
            with outlet.lock:
                self.step(outlet)
            if self.trouble is not None:
                raise self.trouble
            time.sleep(1 / RATE_HZ)

    def step(self, outlet):
        now = outlet.own_time()
        seconds, self.last_step_s = min(now - self.last_step_s, LONGEST_STEP_S), now
        # While this program is not given the processor, neither does the arm move, nor is what arrives read.
        is_silent = outlet.last_message_s == self.heard_s
        self.heard_s, self.silence_s = outlet.last_message_s, self.silence_s + seconds if is_silent else 0.0
        if self.is_armed and self.silence_s > SILENCE_S:
            why = "nothing was heard of the workbench for a second"
            self.brake(why)
            self.is_armed = False
            outlet.send({"type": "disarmed", "why": why})
        ended = None
        if self.motion is not None:
            self.at, is_over = self.motion.step(seconds)
            if is_over:
                ended, self.motion = self.motion, None
        self.report(outlet)
        if ended is not None and ended.why is not None and self.at != ended.goal:
            outlet.send({"type": "stopped", "id": ended.identity, "why": ended.why})
        elif ended is not None:
            outlet.send({"type": "done", "id": ended.identity})
        if self.motion is None:
            for identity in self.at_rest:
                outlet.send({"type": "done", "id": identity})
            self.at_rest = []

    def brake(self, why):
        if self.motion is not None and self.motion.why is None:
            self.motion.why = why

    def command(self, message, outlet):
        with outlet.lock:
            kind, identity = message["type"], message["id"]
            if kind == "arm" and message["on"]:
                self.is_armed = True
                outlet.send({"type": "done", "id": identity})
            elif kind == "move":
                why = self.refusal(message)
                if why is not None:
                    outlet.send({"type": "refused", "id": identity, "why": why})
                    return
                fastest = [message["speed"] * most for most in self.cell.fastest]
                goal = [float(value) for value in message["joints_rad"]]
                self.motion = Motion(identity, self.at, goal, fastest, self.rise)
                outlet.send({"type": "accepted", "id": identity})
            else:
                self.brake("stop" if kind == "stop" else "motion is no longer allowed")
                self.is_armed = self.is_armed and kind == "stop"
                self.at_rest.append(identity)

    def refusal(self, message):
        """Why this move is not made; None where it is."""
        if not self.is_armed:
            return "motion is not allowed: the driver is read-only until it is armed"
        if self.motion is not None:
            return "the arm moves"
        goal, speed = message.get("joints_rad"), message.get("speed")
        if goal is None:
            return "this driver moves to joint values only"
        if len(goal) != len(self.at):
            return f"{len(goal)} joint values for {len(self.at)} joints"
        if not isinstance(speed, (int, float)) or not 0 < speed <= 1:
            return f"a speed of {speed} is not over 0 up to 1"
        for joint, value in zip(self.cell.joints, goal):
            if not joint.get("min", -math.inf) <= value <= joint.get("max", math.inf):
                return f"{value:.4f} is out of the range of {joint['name']}, {joint.get('min')} to {joint.get('max')}"
        return None

    def look(self, outlet):
        """Answers requests for images, in a thread of its own."""
        try:
            seen, newest, last_s = None, None, -math.inf
            while not outlet.ended.is_set():
                time.sleep(max(last_s + BETWEEN_IMAGES_S - outlet.own_time(), 0.005))
                if outlet.wanted is None:
                    if self.camera.poll():  # unasked, there is nothing but a fault
                        self.received()
                    continue
                # A state has exactly the stamp of the image.
                with outlet.lock:
                    stamp, base_from_tip = self.report(outlet)
                    at, is_at_rest = self.at, self.motion is None
                if at != seen:
                    # What is seen on the way has to be quick rather than exact.
                    newest = self.rendered(at, base_from_tip, self.options.samples if is_at_rest else 1)
                    seen = at if is_at_rest else None
                # Rendering takes longer than an exposure. Where the arm has not moved since, the image is as well one of now:
                # all that stands still is seen again. So it is not too old, and an arm at rest is rendered once.
                with outlet.lock:
                    if is_at_rest and self.at == at and self.motion is None:
                        stamp, _ = self.report(outlet)
                colours, depths = newest
                width, height = self.options.size
                depth = (depths, {"stamp": stamp, "encoding": "f32_m"})
                outlet.image(colours, depth, stamp=stamp, width=width, height=height, encoding="rgb8")
                last_s = outlet.own_time()
        except Exception as error:
            self.trouble = error

    def rendered(self, at, base_from_tip, samples):
        try:
            self.camera.send(((at, *self.layout.places(base_from_tip)), samples))
        except OSError:
            pass  # it has ended, and may have said why
        return self.received()

    def received(self):
        try:
            fault, image = self.camera.recv()
        except (EOFError, OSError):
            raise Fault("the process that renders has ended; standard error says why, if it had the time to") from None
        if fault is not None:
            raise Fault(fault)
        return image


# --------------------------------------------------------------------------------------------------------------------- options


def package(name, install):
    """A package, or how to install it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise Fault(f"this Python has no package {error.name}. To install it: {sys.executable} -m pip install {install}") from None


def add_options(options, samples):
    """The options that both cells have. `samples` is how many images are rendered for one if that is not given."""
    side = "the camera stands beside the arm, which carries the board; otherwise the camera is on the arm, the board on the table"
    options.add_argument("--eye-to-hand", action="store_true", help=side)
    board = "a chessboard by its inner corners and the edge of a square, 10x7x15 if not given"
    options.add_argument("--board", metavar="COLUMNSxROWSxMM", type=Board.of_text, default="10x7x15", help=board)
    pixels = "size of the images, 640x480 if not given"
    options.add_argument("--size", metavar="WIDTHxHEIGHT", type=size, default="640x480", help=pixels)
    mean = f"each image is the mean of N, shifted by parts of a pixel, {samples} if not given; fewer make corners less exact"
    options.add_argument("--samples", metavar="N", type=within(1, 256, int), default=samples, help=mean)
    start = (
        "joint values at the start, degrees and millimetres, at which the board is in view; write --start=-10,20,… where the first "
        "is negative"
    )
    options.add_argument("--start", metavar="Q1,Q2,…", type=joint_values, help=start)
    truth = "write where camera and board really are, and the true lens, to this file (JSON)"
    options.add_argument("--truth", metavar="FILE", help=truth)


def joint_values(text):
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError("numbers between commas, in degrees and millimetres") from None


def in_radians(values, joints):
    """Joint values of the options as messages have them."""
    if len(values) != len(joints):
        raise Fault(f"--start has {len(values)} values, and the arm {len(joints)} joints: {', '.join(j['name'] for j in joints)}")
    found = [value / 1000 if joint["kind"] == "prismatic" else math.radians(value) for value, joint in zip(values, joints)]
    for value, joint in zip(found, joints):
        if not joint.get("min", -math.inf) <= value <= joint.get("max", math.inf):
            raise Fault(f"--start is out of the range of {joint['name']}")
    return found


def serve_cell(simulator, options):
    serve(SimulatedCell(simulator, options))
