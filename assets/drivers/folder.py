# /// script
# requires-python = ">=3.9"
# dependencies = ["pillow>=10,<14", "tomli>=2,<3; python_version < '3.11'"]
# ///
r"""A driver of Handeye Workbench that shows each image which comes into a folder, with its pose (docs/drivers/folder.md).

    handeye driver folder captures --length-unit mm --rotation rpy \
        --angle-unit deg --pose base_from_tip

The folder is looked at four times a second rather than watched: that works on every file system, network shares too.
"""

import collections
import csv
import io
import json
import math
import os
import re
import time

from handeye_driver import Fault, conjugate, parser, pose, quaternion, serve, size, times, turned, within

ENDINGS = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")
# Suffixes of a pose file next to its image, in the order of the search.
BESIDE = (".json", ".csv", ".txt")
DESCRIPTION = "dataset.toml"
# Interval of states [s]: the protocol requires ten per second or more.
STATE_S = 0.04
# Interval at which the image is sent again [s]: it is read like a camera, at any time.
SHOW_S = 0.2
# Interval at which the folder is read [s].
LOOK_S = 0.25
# How long reading the initial files may take [s]: less than the workbench waits for `hello`.
FIRST_S = 6.0
# A file that has not changed for this long [s] may be complete; a last line without a newline counts after this long.
SETTLE_S, REST_S = 0.4, 1.0
# What is still missing after this long [s] is reported.
COMPLAIN_S = 3.0
# The protocol takes no more bytes of an image; a pose and a table of poses are shorter.
MOST_IMAGE, MOST_POSE, MOST_TABLE = 64 << 20, 1 << 20, 16 << 20

LENGTHS = {"m": 1.0, "mm": 1e-3}
ANGLES = {"rad": 1.0, "deg": math.pi / 180}
DIRECTIONS = ("base_from_tip", "tip_from_base")
MATRIX = [f"r{row}{column}" for row in "123" for column in "123"]
ROTATIONS = {
    "quaternion_xyzw": ["qx", "qy", "qz", "qw"],
    "quaternion_wxyz": ["qw", "qx", "qy", "qz"],
    "rotation_vector": ["rx", "ry", "rz"],
    "rpy": ["roll", "pitch", "yaw"],
    "matrix": MATRIX,
}
# How far the length of a quaternion may be from 1: three printed decimals stay within it, swapped columns do not.
UNIT_TOLERANCE = 1e-3
# How far the product of a matrix with its transpose may be from 1.
ORTHONORMAL_TOLERANCE = 2 * UNIT_TOLERANCE
# Joints rotate by up to two full turns in either direction.
LARGEST_ANGLE_RAD = 4 * math.pi
MOST_JOINTS = 12

Pose = collections.namedtuple("Pose", "translation rotation joints")
Capture = collections.namedtuple("Capture", "name size encoding data pose modified")


class Wrong(Exception):
    """What is wrong with a file, which is logged; the driver goes on."""


# ---------------------------------------------------------------------------------------------------------------- conventions


class Format:
    """How poses are written: the keys of [robot] in a dataset.toml."""

    def __init__(self, keys):
        def word(key, choices):
            value = keys.get(key)
            if not isinstance(value, (str, int)) or value not in choices:
                shown = "is missing" if value is None else f"= {value!r} is not usable"
                raise Wrong(f"{key} {shown}: it is one of {', '.join(map(str, choices))}")
            return value

        self.table = keys.get("poses", "poses.csv")
        self.metres = LENGTHS[word("length_unit", LENGTHS)]
        self.rotation = word("rotation", ROTATIONS)
        has_angles = self.rotation in ("rotation_vector", "rpy")
        self.radians = ANGLES[word("angle_unit", ANGLES)] if has_angles else None
        self.direction = word("pose", DIRECTIONS)
        self.joints = word("joints", range(1, MOST_JOINTS + 1)) if "joints" in keys else 0
        self.joint_radians = ANGLES[word("joint_unit", ANGLES)] if self.joints else None
        joint_names = [f"q{number}" for number in range(1, self.joints + 1)]
        self.columns = ["x", "y", "z", *ROTATIONS[self.rotation], *joint_names]
        rpy = ["x", "y", "z", *ROTATIONS["rotation_vector"], *joint_names]
        self.headers = [self.columns] + ([rpy] if self.rotation == "rpy" else [])

    def pose(self, cells):
        """The pose that the cells of a row state, in the order of the columns."""
        if len(cells) != len(self.columns):
            raise Wrong(f"{len(cells)} numbers, where {len(self.columns)} are needed: {', '.join(self.columns)}")
        numbers = [number(column, cell) for column, cell in zip(self.columns, cells)]
        end = len(numbers) - self.joints
        translation = [self.metres * value for value in numbers[:3]]
        rotation = self.quaternion(numbers[3:end])
        joints = [angle(value, self.joint_radians, "joint_unit") for value in numbers[end:]]
        if self.direction == "tip_from_base":
            rotation = conjugate(rotation)
            translation = [-value for value in turned(rotation, translation)]
        return Pose(translation, rotation, joints)

    def quaternion(self, values):
        if self.rotation == "quaternion_wxyz":
            values = [*values[1:], values[0]]
        if self.rotation.startswith("quaternion"):
            return unit(values)
        if self.rotation == "matrix":
            return quaternion_of_matrix([values[0:3], values[3:6], values[6:9]])
        angles = [angle(value, self.radians, "angle_unit") for value in values]
        if self.rotation == "rotation_vector":
            return quaternion(angles)
        # As in a URDF: about the fixed axes x, then y, then z.
        roll, pitch, yaw = (quaternion([a * b for b in axis]) for a, axis in zip(angles, ((1, 0, 0), (0, 1, 0), (0, 0, 1))))
        return times(yaw, times(pitch, roll))


def number(column, cell):
    try:
        value = float(cell)
    except (TypeError, ValueError):
        raise Wrong(f"{column} = {cell!r} is not a number") from None
    if not math.isfinite(value):
        raise Wrong(f"{column} = {cell!r} is not finite: leave out views without a pose")
    return value


def angle(value, radians, key):
    if abs(value * radians) > LARGEST_ANGLE_RAD:
        raise Wrong(f"an angle of {value} is more than two turns: check {key}")
    return value * radians


def unit(q):
    length = math.hypot(*q)
    if abs(length - 1) > UNIT_TOLERANCE:
        raise Wrong(f"the quaternion has length {length:.6f}, which is more than {UNIT_TOLERANCE} from 1: check the columns")
    return tuple(value / length for value in q)


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def quaternion_of_matrix(m):
    """The quaternion of the rotation that is nearest to a matrix which is one up to rounding."""
    gram = product([list(row) for row in zip(*m)], m)
    off = max(abs(gram[i][j] - (i == j)) for i in range(3) for j in range(3))
    if not off <= ORTHONORMAL_TOLERANCE:
        raise Wrong(f"r11…r33 is not a rotation matrix: its columns are off orthonormal by {off:.6f}")
    # Each pass squares the distance to the polar factor: 1e-3, 1e-6, 1e-12.
    for _ in range(3):
        gram = product([list(row) for row in zip(*m)], m)
        m = product(m, [[1.5 * (i == j) - 0.5 * gram[i][j] for j in range(3)] for i in range(3)])
    (a, b, c), (d, e, f), (g, h, i) = m
    if a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) < 0:
        raise Wrong("r11…r33 is not a rotation matrix: it mirrors, check the signs and the handedness")
    # Four forms of the same quaternion, each times twice one of its parts: the longest is the most exact.
    forms = (
        (1 + a - e - i, b + d, c + g, h - f),
        (b + d, 1 - a + e - i, f + h, c - g),
        (c + g, f + h, 1 - a - e + i, d - b),
        (h - f, c - g, d - b, 1 + a + e + i),
    )
    best = max(forms, key=lambda form: math.hypot(*form))
    return tuple(value / math.hypot(*best) for value in best)


# ---------------------------------------------------------------------------------------------------------------------- files


class Table:
    """A table of poses that grows."""

    def __init__(self, path, form):
        self.path, self.form = path, form
        self.rows = {}  # path of the image: its name, line and pose
        self.stamp, self.since_s, self.reads = None, 0.0, 0

    def look(self, now_s):
        """Reads it if it has changed, and once more when it has been left alone: then its last line is whole, too."""
        stamp = stamp_of(self.path)
        if stamp is None:
            return
        if stamp != self.stamp:
            self.stamp, self.since_s, self.reads = stamp, now_s, 0
        rests = now_s - self.since_s >= REST_S
        if self.reads > (1 if rests else 0) or self.reads == 1 and not rests:
            return
        self.reads = 2 if rests else 1
        text = read_text(self.path, MOST_TABLE)
        if not rests:
            text = text[: text.rfind("\n") + 1]
        self.rows = self.read(text)

    def read(self, text):
        lines = csv.reader(io.StringIO(text.lstrip("\ufeff")))
        rows, header = {}, None
        for cells in lines:
            cells = [cell.strip() for cell in cells]
            if not any(cells):
                continue
            if header is None:
                header = cells
                continue
            try:
                self.take(rows, header, cells, lines.line_num)
            except Wrong as why:
                raise Wrong(f"{self.path}, row {lines.line_num}: {why}") from None
        return rows

    def take(self, rows, header, cells, line):
        expected = [["image", *columns] for columns in self.form.headers]
        if header not in expected:
            raise Wrong(f"the columns are {','.join(header)}: the header must be {' or '.join(map(','.join, expected))}")
        if len(cells) != len(header):
            raise Wrong(f"{len(cells)} cells, the header has {len(header)}: numbers have a decimal point and no comma")
        path = os.path.normpath(os.path.join(os.path.dirname(self.path), cells[0]))
        if path in rows:
            raise Wrong(f"image {cells[0]!r} is already in row {rows[path][1]}: remove one of the two")
        rows[path] = (cells[0], line, self.form.pose(cells[1:]))


def pose_in_file(path, form):
    """The pose in a file beside an image."""
    try:
        text = read_text(path, MOST_POSE)
        cells = cells_of_json(text, form.columns) if path.endswith(".json") else cells_of_text(text, form.columns)
        return form.pose(cells)
    except Wrong as why:
        raise Wrong(f"{path}: {why}") from None


def cells_of_json(text, columns):
    """A list of numbers in the order of the columns, or an object with the columns as keys."""
    try:
        value = json.loads(text)
    except ValueError as error:
        raise Wrong(str(error)) from None
    if isinstance(value, dict):
        for column in columns:
            if column not in value:
                raise Wrong(f"it has no {column!r}; needed are {', '.join(columns)}")
        return [value[column] for column in columns]
    if isinstance(value, list):
        return value
    raise Wrong("neither a list of numbers nor an object")


def cells_of_text(text, columns):
    """One row of numbers between commas, semicolons or spaces, with the columns above it or without."""
    lines = [[cell for cell in re.split(r"[,;\s]+", line) if cell] for line in text.splitlines()]
    lines = [cells for cells in lines if cells]
    if len(lines) == 2 and lines[0] != columns:
        raise Wrong(f"its columns are {', '.join(lines[0])}, needed are {', '.join(columns)}")
    if len(lines) not in (1, 2):
        raise Wrong(f"{len(lines)} rows, where one pose is needed")
    return lines[-1]


def read_text(path, most):
    try:
        if os.path.getsize(path) > most:
            raise Wrong(f"{path}: longer than the {most} bytes that are read")
        with open(path, encoding="utf-8", newline="") as file:
            return file.read()
    except (OSError, UnicodeDecodeError) as error:
        raise Wrong(f"{path}: {error}") from None


def stamp_of(path):
    """Length and time of change of a file; None where it is not."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def read_image(path):
    """Size, encoding and bytes of an image that is whole. PNG and JPEG stay as they are."""
    from PIL import Image

    with open(path, "rb") as file:
        data = file.read()
    with Image.open(io.BytesIO(data)) as image:
        image.load()
        if data.startswith(b"\x89PNG"):
            return image.size, "png", data
        if data.startswith(b"\xff\xd8"):
            return image.size, "jpeg", data
        return image.size, "rgb8", image.convert("RGB").tobytes()


def natural(name):
    """A key that sorts names as people count: 2 before 10."""
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part) for part in re.split(r"(\d+)", name) if part]


class Watch:
    """What is in the folder, and what of it is whole."""

    def __init__(self, folder, form):
        self.folder, self.form = folder, form
        self.table = Table(os.path.join(folder, form.table), form) if form else None
        self.waiting = {}  # name: stamp, since when it has not changed [s], and whether it was found not to be an image since
        self.taken = set()
        self.rows_since = {}
        self.logged = set()
        self.remarks = []  # lines for the log, each once

    def look(self, now_s):
        """The captures that have become whole since the last look, in the natural order of their names."""
        if self.table:
            try:
                self.table.look(now_s)
            except Wrong as why:
                self.remark(str(why))
        captures = []
        for name in sorted(self.settled(now_s), key=natural):
            try:
                capture = self.capture(name, now_s)
            except Wrong as why:
                self.remark(str(why))
                continue
            if capture:
                del self.waiting[name]
                self.taken.add(name)
                captures.append(capture)
        if self.table:
            self.complain_of_rows(now_s)
        return captures

    def settled(self, now_s):
        """Names of images that were not taken and have not changed for a while."""
        try:
            names = [name for name in os.listdir(self.folder) if name.lower().endswith(ENDINGS)]
        except OSError as error:
            raise Fault(f"{self.folder}: {error}") from None
        found = {}
        for name in names:
            stamp = None if name in self.taken else stamp_of(os.path.join(self.folder, name))
            if stamp is not None:
                known = self.waiting.get(name)
                found[name] = known if known and known[0] == stamp else [stamp, now_s, False]
        self.waiting = found
        return [name for name, (_, since_s, is_no_image) in found.items() if now_s - since_s >= SETTLE_S and not is_no_image]

    def capture(self, name, now_s):
        """The capture of an image; None while something of it may yet come."""
        path = os.path.join(self.folder, name)
        stamp, since_s, _ = self.waiting[name]
        is_late = now_s - since_s >= COMPLAIN_S
        try:
            found = self.pose_of(path) if self.table else None
        except Wrong:
            if is_late:
                raise
            return None
        try:
            dimensions, encoding, data = read_image(path)
        except Exception as error:  # each format has errors of its own
            if not is_late:
                return None
            self.waiting[name][2] = True
            raise Wrong(f"{path}: {error}") from None
        if len(data) > MOST_IMAGE:
            self.waiting[name][2] = True
            raise Wrong(f"{path}: {len(data)} bytes are too many: save it as PNG or JPEG")
        return Capture(name, dimensions, encoding, data, found, stamp[1])

    def pose_of(self, image):
        row = self.table.rows.get(os.path.normpath(image))
        if row:
            return row[2]
        for ending in BESIDE:
            path = os.path.splitext(image)[0] + ending
            if os.path.isfile(path):
                return pose_in_file(path, self.form)
        raise Wrong(f"{image} has no pose: neither a row in {self.table.path} nor a .json, .csv or .txt of its name beside it")

    def complain_of_rows(self, now_s):
        for path, (name, line, _) in self.table.rows.items():
            since_s = self.rows_since.setdefault(path, now_s)
            if now_s - since_s >= COMPLAIN_S and not os.path.isfile(path):
                self.remark(f"{self.table.path}, row {line}: there is no image {name}")

    def remark(self, text):
        if text not in self.logged:
            self.logged.add(text)
            self.remarks.append(text)


# --------------------------------------------------------------------------------------------------------------------- driver


class Folder:
    def __init__(self, folder, form, image_size, hold_s):
        self.folder, self.form, self.size, self.hold_s = folder, form, image_size, hold_s
        self.watch = Watch(folder, form)
        self.current = None

    def open(self, outlet):
        if not os.path.isdir(self.folder):
            raise Fault(f"{self.folder} is no folder")
        self.current = self.newest(outlet)
        if self.current:
            self.size = self.current.size
        if self.size is None:
            why = "\n".join(self.watch.remarks)
            raise Fault(
                f"{self.folder} has no image with its pose yet: put the first there, or say how large images are with --size "
                f"WIDTHxHEIGHT. {why}"
            )
        width, height = self.size
        can = ["image"] + (["state"] if self.form else [])
        hello = {"name": f"folder {self.folder}", "clock": "monotonic", "camera": {"width": width, "height": height}}
        if self.form and self.form.joints:
            can.append("joints")
            hello["joints"] = [{"name": f"q{i + 1}", "kind": "revolute"} for i in range(self.form.joints)]
        return {**hello, "can": can}

    def newest(self, outlet):
        """The newest of the captures that are there already."""
        start_s = outlet.own_time()
        found, looks = [], 0
        while True:
            found += self.watch.look(outlet.own_time())
            looks += 1
            # What the first scan has found is settled by the third.
            is_read = looks > 2 and (found or not self.watch.waiting)
            if is_read or outlet.own_time() - start_s > FIRST_S:
                return max(found, key=lambda capture: capture.modified, default=None)
            time.sleep(LOOK_S)

    def run(self, outlet):
        queue = collections.deque()
        looked_s = shown_s = changed_s = -math.inf
        if self.current:
            outlet.log("info", f"{self.current.name} is shown; what comes next is shown as it comes")
        while not outlet.ended.is_set():
            now_s = outlet.own_time()
            if now_s - looked_s >= LOOK_S:
                looked_s = now_s
                self.look(queue, now_s, outlet)
            if queue and now_s - changed_s >= self.hold_s:
                self.current, changed_s = queue.popleft(), now_s
                outlet.log("info", f"{self.current.name} is shown")
                # A state with the new pose comes before the image.
                shown_s = now_s
            if self.current:
                self.show_pose(now_s, outlet)
                if now_s - shown_s >= SHOW_S:
                    shown_s = now_s
                    self.show_image(now_s, outlet)
            time.sleep(STATE_S)

    def look(self, queue, now_s, outlet):
        for capture in self.watch.look(now_s):
            if capture.size == self.size:
                queue.append(capture)
            else:
                (w, h), (width, height) = capture.size, self.size
                outlet.log("error", f"{capture.name} is {w}×{h} and the images before it {width}×{height}: it is not shown")
        for remark in self.watch.remarks:
            outlet.log("warn", remark)
        self.watch.remarks.clear()

    def show_pose(self, now_s, outlet):
        found = self.current.pose
        if found:
            joints = found.joints or None
            outlet.state(now_s, joints_rad=joints, base_from_tip=pose(found.translation, found.rotation), moving=False)

    def show_image(self, now_s, outlet):
        width, height = self.size
        outlet.image(self.current.data, stamp=now_s, width=width, height=height, encoding=self.current.encoding)


KEYS = ("poses", "length_unit", "rotation", "angle_unit", "pose", "joints", "joint_unit")


def conventions(options):
    """From the options, or from the folder's dataset.toml where there are none."""
    given = {key: getattr(options, key) for key in KEYS if getattr(options, key) is not None}
    if options.images_only:
        if given:
            raise Wrong("--images-only is for folders without poses, and options say how poses are written")
        return None
    description = os.path.join(options.folder, DESCRIPTION)
    if given or not os.path.exists(description):
        if not given:
            raise Wrong(
                f"how are poses written in {options.folder}? Say it with --length-unit {'|'.join(LENGTHS)}, --rotation "
                f"{'|'.join(ROTATIONS)}, --angle-unit {'|'.join(ANGLES)} (of rotation_vector and rpy) and --pose "
                f"{'|'.join(DIRECTIONS)}, or in a dataset.toml there; --images-only where there are no poses"
            )
        return Format(given)
    try:
        import tomllib
    except ImportError:
        import tomli as tomllib
    try:
        robot = tomllib.loads(read_text(description, MOST_TABLE)).get("robot")
        if robot is None:
            raise Wrong("it has no [robot], which says how poses are written; --images-only where there are none")
        return Format(robot)
    except (Wrong, tomllib.TOMLDecodeError) as why:
        raise Wrong(f"{description}: {why}") from None


def main():
    options = parser(__doc__)
    options.add_argument("folder", metavar="DIR", help="the folder")
    options.add_argument("--images-only", action="store_true", help="there are no poses, only images")
    options.add_argument("--size", metavar="WIDTHxHEIGHT", type=size, help="size of the images, such as 1280x720, needed while there is none yet")
    options.add_argument(
        "--hold", metavar="SECONDS", type=within(0, 3600), default=2.0, help="how long each capture is shown at least before the next, in seconds"
    )
    robot = options.add_argument_group("how poses are written", "the keys of [robot] in a dataset.toml, taken from there if none is given")
    robot.add_argument("--poses", metavar="FILE", help="table of poses in the folder; poses.csv if not given")
    robot.add_argument("--length-unit", choices=LENGTHS, help="unit of positions")
    robot.add_argument("--rotation", metavar="WORD", choices=ROTATIONS, help=f"how rotations are written: {', '.join(ROTATIONS)}")
    robot.add_argument("--angle-unit", choices=ANGLES, help="unit of rotation_vector and rpy")
    robot.add_argument("--pose", metavar="WORD", choices=DIRECTIONS, help=f"what a pose states: {' or '.join(DIRECTIONS)}")
    robot.add_argument("--joints", metavar="N", type=int, help="how many joint angles follow the rotation")
    robot.add_argument("--joint-unit", choices=ANGLES, help="unit of joint angles")
    chosen = options.parse_args()
    try:
        form = conventions(chosen)
    except Wrong as why:
        options.error(str(why))
    serve(Folder(chosen.folder, form, chosen.size, chosen.hold))


if __name__ == "__main__":
    main()
