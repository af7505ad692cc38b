#!/usr/bin/env python3
"""Reads the exports of handeye with the libraries that their users have, and compares them with the result.

usage: read_exports.py EXPORT_FOLDER RESULT_JSON

The folder holds some of calibration.json, camera_info.yaml, opencv.yaml and *.calib, with the default frame names.
Needs OpenCV (cv2), NumPy and PyYAML. Prints one line per file and exits with 1 when a file differs, 2 when there is none.
"""

import json
import pathlib
import sys

import cv2
import numpy as np
import yaml

TOLERANCE = 1e-9
ROS_MODELS = {"none": "plumb_bob", "brown_conrady": "plumb_bob", "rational": "rational_polynomial", "fisheye": "equidistant"}


def matrix_of(transform):
    """4x4 matrix of a transform of the result, from its quaternion."""
    x, y, z, w = transform["rotation_xyzw"]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = transform["translation_m"]
    return out


def close(what, got, expected):
    got, expected = np.asarray(got, dtype=float), np.asarray(expected, dtype=float)
    assert got.shape == expected.shape, f"{what}: shape {got.shape}, not {expected.shape}"
    difference = np.max(np.abs(got - expected), initial=0.0)
    assert difference <= TOLERANCE, f"{what}: differs by {difference}"


def coefficients(intrinsics):
    return intrinsics["distortion"] if intrinsics["model"] != "none" else [0.0] * 5


def camera_matrix(intrinsics):
    return np.array([[intrinsics["fx"], 0, intrinsics["cx"]], [0, intrinsics["fy"], intrinsics["cy"]], [0, 0, 1]])


def parent_frame(result):
    return "tool0" if result["mode"] == "eye_in_hand" else "base_link"


def check_opencv(path, result):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), "OpenCV does not open it"
    intrinsics, hand_eye = result["intrinsics"], result["hand_eye"]
    if intrinsics:
        assert int(storage.getNode("image_width").real()) == intrinsics["width"]
        assert int(storage.getNode("image_height").real()) == intrinsics["height"]
        assert storage.getNode("distortion_model").string() == intrinsics["model"]
        close("camera_matrix", storage.getNode("camera_matrix").mat(), camera_matrix(intrinsics))
        got = storage.getNode("distortion_coefficients").mat()
        close("distortion_coefficients", got, [coefficients(intrinsics)])
        check_projection(storage.getNode("camera_matrix").mat(), got, intrinsics)
    if hand_eye:
        name = f"T_{parent_frame(result)}_camera_color_optical_frame"
        close(name, storage.getNode(name).mat(), matrix_of(hand_eye))
    if result["quality"]["rms_px"] is not None:
        close("avg_reprojection_error", storage.getNode("avg_reprojection_error").real(), result["quality"]["rms_px"])
    storage.release()


def check_projection(matrix, distortion, intrinsics):
    """OpenCV takes what it read for a camera, in the function that the model belongs to."""
    points = np.array([[[0.1, -0.05, 1.0]], [[-0.2, 0.1, 1.5]]])
    zero = np.zeros(3)
    if intrinsics["model"] == "fisheye":
        pixels, _ = cv2.fisheye.projectPoints(points, zero, zero, matrix, distortion)
    else:
        pixels, _ = cv2.projectPoints(points, zero, zero, matrix, distortion)
    assert np.all(np.isfinite(pixels)), "OpenCV cannot project with these intrinsics"


def check_ros(path, result):
    document, intrinsics = yaml.safe_load(path.read_text(encoding="utf-8")), result["intrinsics"]
    assert (document["image_width"], document["image_height"]) == (intrinsics["width"], intrinsics["height"])
    assert document["camera_name"] == "camera_color"
    assert document["distortion_model"] == ROS_MODELS[intrinsics["model"]]

    def matrix(key):
        node = document[key]
        assert all(isinstance(v, float) for v in node["data"]), f"{key} has numbers that YAML does not take for floats"
        return np.reshape(node["data"], (node["rows"], node["cols"]))

    k = camera_matrix(intrinsics)
    close("camera_matrix", matrix("camera_matrix"), k)
    close("distortion_coefficients", matrix("distortion_coefficients"), [coefficients(intrinsics)])
    close("rectification_matrix", matrix("rectification_matrix"), np.eye(3))
    close("projection_matrix", matrix("projection_matrix"), np.hstack([k, np.zeros((3, 1))]))


def check_easy_handeye2(path, result):
    document = yaml.safe_load(path.read_text(encoding="utf-8"))
    parameters, transform = document["parameters"], document["transform"]
    expected_type = "eye_in_hand" if result["mode"] == "eye_in_hand" else "eye_on_base"
    assert parameters["calibration_type"] == expected_type, parameters
    assert parameters["freehand_robot_movement"] is True
    frames = ["robot_base_frame", "robot_effector_frame", "tracking_base_frame", "tracking_marker_frame"]
    assert [parameters[f] for f in frames] == ["base_link", "tool0", "camera_color_optical_frame", "board"], parameters
    close("translation", [transform["translation"][k] for k in "xyz"], result["hand_eye"]["translation_m"])
    rotation = np.array([transform["rotation"][k] for k in "xyzw"])
    assert rotation[3] >= 0.0, "w is negative"
    close("length of the quaternion", np.linalg.norm(rotation), 1.0)
    expected = np.array(result["hand_eye"]["rotation_xyzw"])
    close("rotation", rotation, expected if expected[3] >= 0.0 else -expected)


def check_json(path, result):
    assert json.loads(path.read_text(encoding="utf-8")) == result


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    folder = pathlib.Path(sys.argv[1])
    result = json.loads(pathlib.Path(sys.argv[2]).read_text(encoding="utf-8"))
    readers = {
        "calibration.json": check_json,
        "camera_info.yaml": check_ros,
        "opencv.yaml": check_opencv,
        "*.calib": check_easy_handeye2,
    }
    failed, found = 0, 0
    for pattern, check in readers.items():
        for path in sorted(folder.glob(pattern)):
            found += 1
            try:
                check(path, result)
                print(f"ok {path.name}")
            except (AssertionError, KeyError, TypeError, cv2.error, yaml.YAMLError) as error:
                failed += 1
                print(f"FAILED {path.name}: {error!r}")
    if found == 0:
        print(f"no exports in {folder}")
        sys.exit(2)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
