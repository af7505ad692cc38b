#!/usr/bin/env python3
"""Reads a recording of `handeye auto` with the Rerun package and compares it with the session that it was made from.

usage: read_recording.py RECORDING.rrd SESSION_FOLDER

The session must be of a camera on the tip, with every capture in the fit and one calibration at the end. Transforms that
are composed from the recording have to be those of the result, and to put the corners where the result puts them. Prints
one line per check; exits with 1 when one fails.
"""

import collections
import json
import pathlib
import sys

import numpy as np
from rerun.experimental import RrdReader

# Millionths of a metre and of a radian: what is left of a chain of three transforms in 32 bits.
TRANSFORM_TOLERANCE = 1e-6
PIXEL_TOLERANCE = 0.01
# Rerun's pixel (0, 0) is the corner of the image, ours the middle of its first pixel.
PIXEL_SHIFT = 0.5
RESIDUAL_FACTOR = 50.0
UNCERTAINTY_FACTOR = 100.0
CHI_SQUARE_3_95 = 7.814728

CAMERA = "/base/tip/camera"
BOARD = "/base/board"
TIMELINES = {"capture", "sim_time", "log_time"}


class Recording:
    """All rows of the first recording of a file, by entity and component."""

    def __init__(self, path):
        reader = RrdReader(path)
        (self.store,) = reader.recordings()
        self.blueprints = reader.blueprints()
        self.timelines = set()
        self.static = collections.defaultdict(dict)
        self.rows = collections.defaultdict(lambda: collections.defaultdict(list))
        self.cleared = collections.defaultdict(list)
        for chunk in reader.stream().to_chunks():
            self._add(chunk)

    def _add(self, chunk):
        batch = chunk.to_record_batch()
        columns = {field.name: batch.column(i) for i, field in enumerate(batch.schema)}
        ids = [bytes(value.as_py()) for value in columns["rerun.controls.RowId"]]
        times = {}
        for name in chunk.timeline_names:
            self.timelines.add(name)
            times[name] = columns[name].cast("int64").to_pylist()
        for field in batch.schema:
            component = (field.metadata or {}).get(b"rerun:component")
            if component is None:
                continue
            component = component.decode()
            for row, value in enumerate(columns[field.name]):
                if not value.is_valid:
                    continue
                if chunk.is_static:
                    self.static[chunk.entity_path][component] = value
                    continue
                at = {name: time[row] for name, time in times.items() if time[row] is not None}
                self.rows[chunk.entity_path][component].append((at, ids[row], value))

    def entities(self):
        return set(self.static) | set(self.rows)

    def all(self, entity, component):
        """Every row with its times, in the order in which it was written."""
        return sorted(self.rows[entity][component], key=lambda row: row[1])

    def at(self, entity, component, capture):
        """What a viewer shows on the time line of captures; None where there is nothing yet."""
        if component in self.static[entity]:
            return self.static[entity][component].as_py()
        seen = [(at["capture"], row, value) for at, row, value in self.all(entity, component)
                if at.get("capture", np.inf) <= capture]
        return max(seen, key=lambda row: row[:2])[2].as_py() if seen else None

    def transform(self, entity, capture):
        """parent_from_child of one entity."""
        translation = self.at(entity, "Transform3D:translation", capture)
        quaternion = self.at(entity, "Transform3D:quaternion", capture)
        assert translation is not None and quaternion is not None, f"{entity} has no transform at capture {capture}"
        return matrix_of(translation[0], quaternion[0])

    def pixels(self, entity, capture):
        positions = self.at(entity, "Points2D:positions", capture)
        return np.array(positions if positions is not None else [], dtype=float).reshape(-1, 2) - PIXEL_SHIFT

    def text(self, entity, capture):
        text = self.at(entity, "TextDocument:text", capture)
        return None if text is None else text[0]


def matrix_of(translation, xyzw):
    """4x4 matrix of a translation and a quaternion, which a viewer normalises."""
    x, y, z, w = np.array(xyzw, dtype=float) / np.linalg.norm(np.array(xyzw, dtype=float))
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = translation
    return out


def of_estimate(estimate):
    return matrix_of(estimate["translation_m"], estimate["rotation_xyzw"])


def project(points, matrix, distortion):
    """Pixels of points in the camera, with the distortion of OpenCV's first model."""
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    k1, k2, p1, p2, k3 = (list(distortion) + [0.0] * 5)[:5]
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([matrix[0, 0] * u + matrix[0, 2], matrix[1, 1] * v + matrix[1, 2]], axis=1)


def board_points(target):
    columns, rows, side = target["columns"], target["rows"], target["square_m"]
    return np.array([[c * side, r * side, 0.0, 1.0] for r in range(rows) for c in range(columns)])


def in_camera(camera_from_target, points):
    return (points @ camera_from_target.T)[:, :3]


def lens_of(recording, entity, capture):
    """The projection of a lens in our pixels."""
    flat = np.array(recording.at(entity, "Pinhole:image_from_camera", capture)[0], dtype=float)
    matrix = flat.reshape(3, 3).T
    matrix[:2, 2] -= PIXEL_SHIFT
    return matrix


def close(what, got, expected, tolerance):
    got, expected = np.asarray(got, dtype=float), np.asarray(expected, dtype=float)
    assert got.shape == expected.shape, f"{what}: shape {got.shape}, not {expected.shape}"
    difference = float(np.max(np.abs(got - expected), initial=0.0))
    assert difference <= tolerance, f"{what}: differs by {difference}, more than {tolerance}"
    return difference


class Check:
    """What a recording is compared with."""

    def __init__(self, recording, folder):
        self.recording = Recording(recording)
        self.folder = folder
        self.session = json.loads((folder / "session.json").read_text())
        self.result = json.loads((folder / "result.json").read_text())
        self.captures = self.session["captures"]
        self.last = len(self.captures)
        self.points = board_points(self.session["target"])

    def entity(self, capture):
        return f"/base/captures/{capture['id']}"

    def lens_and_distortion(self, entity):
        return lens_of(self.recording, entity, self.last), self.result["intrinsics"]["distortion"]

    def entities_and_timelines(self):
        there = self.recording.entities()
        expected = {
            "/base", "/base/tip", CAMERA, f"{CAMERA}/lens", f"{CAMERA}/lens/image", f"{CAMERA}/lens/depth",
            f"{CAMERA}/lens/corners", f"{CAMERA}/uncertainty_95_x100", BOARD, f"{BOARD}/outline", f"{BOARD}/corners",
            f"{BOARD}/uncertainty_95_x100", "/base/points", "/base/arm", "/truth/camera", "/truth/camera/lens",
            "/truth/board", "/truth/board/outline", "/plots/residual/fit", "/plots/expected_error", "/plots/joints",
            "/report", "/result",
        }
        expected |= {f"/base/arm/link_{n}" for n in range(7)}
        expected |= {f"/base/trajectory/{which}/0" for which in ("session", "since_connect")}
        below = ("lens", "lens/image", "lens/corners", "lens/predicted", "lens/residuals_x50", "seen_board",
                 "predicted_board")
        for capture in self.captures:
            expected |= {self.entity(capture)} | {f"{self.entity(capture)}/{child}" for child in below}
        missing = sorted(expected - there)
        assert not missing, f"missing: {missing}"
        assert self.recording.timelines == TIMELINES, self.recording.timelines
        return f"{len(there)} entities, time lines {sorted(self.recording.timelines)}"

    def frusta(self):
        frusta = {entity for entity in self.recording.entities()
                  if entity.startswith("/base/captures/") and entity.endswith("/lens")
                  and self.recording.at(entity, "Pinhole:image_from_camera", self.last) is not None}
        assert len(frusta) == self.last, f"{len(frusta)} frusta for {self.last} captures"
        colours = {}
        for number, capture in enumerate(self.captures, start=1):
            entity = f"{self.entity(capture)}/lens"
            first = min(at["capture"] for at, _, _ in self.recording.all(entity, "Pinhole:image_from_camera"))
            assert first == number, f"capture {capture['id']} appears at {first}, not {number}"
            colours[number] = self.recording.at(entity, "Pinhole:color", self.last)[0]
            image = self.recording.at(f"{entity}/image", "EncodedImage:blob", number)[0]
            assert bytes(image) == (self.folder / capture["image"]).read_bytes(), f"image of {capture['id']}"
        residuals = [view["rms_px"] for view in self.result["views"]]
        # Red is the high byte: the view that fits worst is redder than the one that fits best.
        worst, best = np.argmax(residuals) + 1, np.argmin(residuals) + 1
        if max(residuals) > 1.05 * min(residuals):
            assert colours[worst] >> 24 > colours[best] >> 24, "colours do not follow the residuals"
        return f"{len(frusta)} frusta with their images"

    def transforms(self):
        close("tip_from_camera", self.recording.transform(CAMERA, self.last), of_estimate(self.result["hand_eye"]),
              TRANSFORM_TOLERANCE)
        close("base_from_target", self.recording.transform(BOARD, self.last), of_estimate(self.result["target"]),
              TRANSFORM_TOLERANCE)
        worst = 0.0
        for number, capture in enumerate(self.captures, start=1):
            base_from_tip = of_estimate(capture["base_from_tip"])
            close("base_from_tip", self.recording.transform("/base/tip", number), base_from_tip, TRANSFORM_TOLERANCE)
            composed = self.recording.transform("/base/tip", number) @ self.recording.transform(CAMERA, self.last)
            expected = base_from_tip @ of_estimate(self.result["hand_eye"])
            close("base_from_camera", composed, expected, TRANSFORM_TOLERANCE)
            placed = self.recording.transform(self.entity(capture), self.last)
            worst = max(worst, close("base_from_camera of the capture", placed, expected, TRANSFORM_TOLERANCE))
        return f"transforms are those of the result to {worst:.1e}"

    def projections(self):
        """Corners by the recording alone against corners by session and result in 64 bits, and against its own marks."""
        exact = self.result["intrinsics"]
        exact_lens = np.array([[exact["fx"], 0, exact["cx"]], [0, exact["fy"], exact["cy"]], [0, 0, 1.0]])
        worst_chain, worst_marks = 0.0, 0.0
        for capture in self.captures:
            entity = self.entity(capture)
            lens, distortion = self.lens_and_distortion(f"{entity}/lens")
            placed = self.recording.transform(entity, self.last)
            chain = np.linalg.inv(placed) @ self.recording.transform(BOARD, self.last)
            base_from_camera = of_estimate(capture["base_from_tip"]) @ of_estimate(self.result["hand_eye"])
            exact_chain = np.linalg.inv(base_from_camera) @ of_estimate(self.result["target"])
            got = project(in_camera(chain, self.points), lens, distortion)
            expected = project(in_camera(exact_chain, self.points), exact_lens, distortion)
            worst_chain = max(worst_chain, close(f"{entity}: projections", got, expected, PIXEL_TOLERANCE))
            fitted = self.recording.transform(f"{entity}/predicted_board", self.last)
            marks = self.recording.pixels(f"{entity}/lens/predicted", self.last)
            got = project(in_camera(fitted, self.points), lens, distortion)
            assert len(marks) == len(got), f"{entity}: {len(marks)} predicted corners"
            worst_marks = max(worst_marks, close(f"{entity}: predicted corners", got, marks, PIXEL_TOLERANCE))
        return f"projections agree to {worst_chain:.1e} px with the result and to {worst_marks:.1e} px with the marks"

    def residuals(self):
        worst = 0.0
        for capture, view in zip(self.captures, self.result["views"]):
            lens = f"{self.entity(capture)}/lens"
            corners = self.recording.pixels(f"{lens}/corners", self.last)
            predicted = self.recording.pixels(f"{lens}/predicted", self.last)
            arrows = np.array(self.recording.at(f"{lens}/residuals_x50", "Arrows2D:vectors", self.last), dtype=float)
            rms = float(np.sqrt(np.mean(np.sum((corners - predicted) ** 2, axis=1))))
            worst = max(worst, abs(rms - view["rms_px"]))
            # A pixel in 32 bits is known to 3e-5, and the arrow is its difference times the factor.
            close("residuals", arrows, (corners - predicted) * RESIDUAL_FACTOR, 0.01)
        assert worst < 1e-3, f"residuals differ from the result's by {worst} px"
        return f"residuals are those of the result to {worst:.1e} px"

    def seen_boards(self):
        """Robot, camera and what the image alone says put the board where the calibration has it, to its noise."""
        worst = 0.0
        centre = self.points[:, :4].mean(axis=0)
        board = self.recording.transform(BOARD, self.last) @ centre
        for capture in self.captures:
            entity = self.entity(capture)
            seen = self.recording.transform(entity, self.last) @ self.recording.transform(f"{entity}/seen_board", self.last)
            worst = max(worst, float(np.linalg.norm((seen @ centre - board)[:3])))
        assert worst < 2e-3, f"the board is seen {worst * 1e3:.2f} mm away from where it is"
        return f"boards as seen are within {worst * 1e3:.3f} mm of the calibrated one"

    def truth(self):
        truth = self.session["ground_truth"]
        close("true board", self.recording.transform("/truth/board", self.last), of_estimate(truth["target"]),
              TRANSFORM_TOLERANCE)
        expected = of_estimate(self.captures[-1]["base_from_tip"]) @ of_estimate(truth["hand_eye"])
        close("true camera", self.recording.transform("/truth/camera", self.last), expected, TRANSFORM_TOLERANCE)
        return "the truth is that of the session"

    def uncertainty(self):
        for entity, estimate in ((CAMERA, self.result["hand_eye"]), (BOARD, self.result["target"])):
            covariance = np.array(estimate["covariance"])[:3, :3]
            expected = UNCERTAINTY_FACTOR * np.sqrt(CHI_SQUARE_3_95 * np.linalg.eigvalsh(covariance))
            half = self.recording.at(f"{entity}/uncertainty_95_x100", "Ellipsoids3D:half_sizes", self.last)[0]
            close(f"ellipsoid of {entity}", np.sort(half), np.sort(expected), 1e-6)
            label = self.recording.at(f"{entity}/uncertainty_95_x100", "Ellipsoids3D:labels", self.last)[0]
            assert "100 times larger" in label, label
        return "ellipsoids are those of the covariances, and say how much larger they are drawn"

    def points_on_board(self):
        points = np.array(self.recording.at("/base/points", "Points3D:positions", self.last), dtype=float)
        target_from_base = np.linalg.inv(self.recording.transform(BOARD, self.last))
        local = np.column_stack([points, np.ones(len(points))]) @ target_from_base.T
        width, height = self.points[:, 0].max(), self.points[:, 1].max()
        inside = (local[:, 0] > 0) & (local[:, 0] < width) & (local[:, 1] > 0) & (local[:, 1] < height)
        off = np.abs(local[inside, 2])
        assert inside.sum() >= 50, f"{inside.sum()} of {len(points)} points are on the board"
        assert np.median(off) < 2e-3, f"points are {np.median(off) * 1e3:.2f} mm off the board"
        return f"{inside.sum()} of {len(points)} points lie on the board, to {np.median(off) * 1e3:.2f} mm (median)"

    def numbers(self):
        quality = self.result["quality"]
        for entity, expected in (("/plots/residual/fit", quality["rms_px"]),
                                 ("/plots/expected_error", quality["tip_error_95_mm"])):
            close(entity, self.recording.at(entity, "Scalars:scalars", self.last), [expected], 1e-9)
        joints = self.recording.at("/plots/joints", "Scalars:scalars", 1)
        close("joints", joints, np.degrees(self.captures[0]["joints_rad"]), 1e-9)
        return "numbers are those of the result"

    def documents(self):
        recorded = json.loads(self.recording.text("/result", self.last))
        for part in ("format", "version", "mode", "hand_eye", "target", "intrinsics", "quality", "methods"):
            assert recorded[part] == self.result[part], f"{part} is not that of result.json"
        report = self.recording.text("/report", self.last)
        assert self.recording.at("/report", "TextDocument:media_type", self.last) == ["text/markdown"]
        assert f"{self.result['quality']['tip_error_95_mm']:.3f} mm" in report, report
        return "result and report are there, to the last digit"

    def scrubbing(self):
        """Before the calibration there was none, and the scene was that of the capture."""
        for number in range(1, self.last):
            assert self.recording.at(BOARD, "Transform3D:translation", number) is None, f"a board at capture {number}"
            assert self.recording.text("/report", number) is None, f"a report at capture {number}"
            image = bytes(self.recording.at(f"{CAMERA}/lens/image", "EncodedImage:blob", number)[0])
            assert image == (self.folder / self.captures[number - 1]["image"]).read_bytes(), f"image at {number}"
            later = self.entity(self.captures[number])
            assert self.recording.at(later, "Transform3D:translation", number) is None, f"{later} at {number}"
        times = [at["sim_time"] * 1e-9 for at, _, _ in self.recording.all("/base/tip", "Transform3D:translation")
                 if "sim_time" in at]
        for capture in self.captures:
            # The robot is recorded ten times per second or oftener while it is watched.
            assert np.min(np.abs(np.array(times) - capture["sim_time_s"])) < 0.25, f"no tip at {capture['sim_time_s']} s"
        return "stepping back shows the scene as it was"

    def blueprint(self):
        assert self.recording.store.application_id == "handeye-workbench", self.recording.store
        assert self.recording.blueprints, "no blueprint"
        return f"{len(self.recording.blueprints)} blueprint(s)"


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    check = Check(sys.argv[1], pathlib.Path(sys.argv[2]))
    failed = 0
    for part in (check.entities_and_timelines, check.frusta, check.transforms, check.projections, check.residuals,
                 check.seen_boards, check.truth, check.uncertainty, check.points_on_board, check.numbers, check.documents,
                 check.scrubbing, check.blueprint):
        try:
            print(f"ok   {part.__name__}: {part()}")
        except (AssertionError, KeyError, TypeError, IndexError, ValueError) as error:
            failed += 1
            print(f"FAIL {part.__name__}: {type(error).__name__}: {error}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
