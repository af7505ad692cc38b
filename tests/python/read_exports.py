#!/usr/bin/env python3
"""Reads the exports of handeye with the libraries that their users have, and compares them with the result.

usage: read_exports.py EXPORT_FOLDER RESULT_JSON [CONTEXT_JSON]
       read_exports.py --cases FOLDER

With --cases every folder in FOLDER has exports/, result.json and context.json. A context has the names of the export
(`names`) and its views (`views`: name, translation_m, rotation_xyzw of base_from_tip); without one the names are the
defaults and there are no views.

Readers: OpenCV, PyYAML, urdf_parser_py, Pinocchio, xacro, pycolmap, a POSIX shell, and Python's json, ast, csv and XML. Where
a format's own reader is not on PyPI (ROS, Kalibr, mrcal, ViSP, Zivid, MATLAB, nerfstudio, Universal Robots' driver), its checks
are written down here. Prints one line per file; exits with 1 when a file differs or has no reader, 2 when there is none.
"""

import ast
import csv
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import cv2
import numpy as np
import pinocchio
import pycolmap
import xacro
import yaml
from urdf_parser_py.urdf import URDF

TOLERANCE = 1e-9
ROS_MODELS = {"none": "plumb_bob", "brown_conrady": "plumb_bob", "rational": "rational_polynomial", "fisheye": "equidistant"}
DEFAULT_NAMES = {
    "calibration": "my_cell", "camera_name": "camera_color", "base_frame": "base_link", "effector_frame": "tool0",
    "camera_frame": "camera_color_optical_frame", "target_frame": "board", "camera_link": None,
}


def matrix_of(translation, xyzw):
    """4x4 matrix of a translation and a quaternion."""
    x, y, z, w = xyzw
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = translation
    return out


def matrix_of_rpy(translation, rpy):
    """URDF: turns about fixed x, then y, then z."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    out = np.eye(4)
    out[:3, :3] = (
        np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
        @ np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
        @ np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    )
    out[:3, 3] = translation
    return out


def matrix_of_vector(translation, vector):
    """Rotation vector, by OpenCV."""
    out = np.eye(4)
    out[:3, :3] = cv2.Rodrigues(np.array(vector, dtype=float))[0]
    out[:3, 3] = translation
    return out


def close(what, got, expected):
    got, expected = np.asarray(got, dtype=float), np.asarray(expected, dtype=float)
    assert got.shape == expected.shape, f"{what}: shape {got.shape}, not {expected.shape}"
    difference = np.max(np.abs(got - expected), initial=0.0)
    assert difference <= TOLERANCE, f"{what}: differs by {difference}"


def equal(what, got, expected):
    assert got == expected, f"{what}: {got!r}, not {expected!r}"


def unit(xyzw):
    assert xyzw[3] >= 0.0, "w is negative"
    close("length of the quaternion", np.linalg.norm(xyzw), 1.0)
    return xyzw


class Case:
    """What the files have to say."""

    def __init__(self, result, context):
        self.result = result
        self.names = context.get("names", DEFAULT_NAMES)
        self.views = context.get("views", [])
        self.intrinsics, self.hand_eye = result["intrinsics"], result["hand_eye"]
        self.in_hand = result["mode"] == "eye_in_hand"
        self.parent = self.names["effector_frame" if self.in_hand else "base_frame"]
        self.child = self.names["camera_frame"]
        self.published_child, link = self.child, self.names["camera_link"]
        if self.hand_eye:
            self.parent_from_camera = matrix_of(self.hand_eye["translation_m"], self.hand_eye["rotation_xyzw"])
            self.published = self.parent_from_camera
            if link:
                self.published_child = link["frame"]
                link_from_optical = matrix_of(link["translation_m"], link["rotation_xyzw"])
                self.published = self.parent_from_camera @ np.linalg.inv(link_from_optical)

    def camera_matrix(self):
        k = self.intrinsics
        return np.array([[k["fx"], 0, k["cx"]], [0, k["fy"], k["cy"]], [0, 0, 1]])

    def coefficients(self):
        return self.intrinsics["distortion"] if self.intrinsics["model"] != "none" else [0.0] * 5

    def pixels(self, points):
        """OpenCV's own projection of points in the camera."""
        zero, points = np.zeros(3), np.array(points).reshape(-1, 1, 3)
        coefficients = np.array(self.coefficients())
        if self.intrinsics["model"] == "fisheye":
            pixels, _ = cv2.fisheye.projectPoints(points, zero, zero, self.camera_matrix(), coefficients)
        else:
            pixels, _ = cv2.projectPoints(points, zero, zero, self.camera_matrix(), coefficients)
        return pixels.reshape(-1, 2)

    def base_from_camera(self, view):
        return matrix_of(view["translation_m"], view["rotation_xyzw"]) @ self.parent_from_camera


POINTS = [[0.1, -0.05, 1.0], [-0.2, 0.1, 1.5], [0.0, 0.0, 0.7], [0.25, 0.2, 0.9]]


def check_json(path, case):
    assert json.loads(path.read_text(encoding="utf-8")) == case.result


def check_opencv(path, case):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    assert storage.isOpened(), "OpenCV does not open it"
    intrinsics = case.intrinsics
    if intrinsics:
        equal("image_width", storage.getNode("image_width").real(), intrinsics["width"])
        equal("image_height", storage.getNode("image_height").real(), intrinsics["height"])
        equal("distortion_model", storage.getNode("distortion_model").string(), intrinsics["model"])
        close("camera_matrix", storage.getNode("camera_matrix").mat(), case.camera_matrix())
        close("distortion_coefficients", storage.getNode("distortion_coefficients").mat(), [case.coefficients()])
        assert np.all(np.isfinite(case.pixels(POINTS))), "OpenCV cannot project with these intrinsics"
    if case.hand_eye:
        name = re.sub(r"[^A-Za-z0-9]", "_", f"T_{case.parent}_{case.child}")
        close(name, storage.getNode(name).mat(), case.parent_from_camera)
    rms = case.result["quality"]["rms_px"]
    if rms is not None:
        close("avg_reprojection_error", storage.getNode("avg_reprojection_error").real(), rms)
    storage.release()


def check_ros_camera_info(path, case):
    document, intrinsics = load_yaml(path), case.intrinsics
    equal("size", (document["image_width"], document["image_height"]), (intrinsics["width"], intrinsics["height"]))
    equal("camera_name", document["camera_name"], case.names["camera_name"])
    equal("distortion_model", document["distortion_model"], ROS_MODELS[intrinsics["model"]])

    def matrix(key):
        node = document[key]
        assert all(isinstance(v, float) for v in node["data"]), f"{key} has numbers that YAML does not take for floats"
        return np.reshape(node["data"], (node["rows"], node["cols"]))

    k = case.camera_matrix()
    close("camera_matrix", matrix("camera_matrix"), k)
    close("distortion_coefficients", matrix("distortion_coefficients"), [case.coefficients()])
    close("rectification_matrix", matrix("rectification_matrix"), np.eye(3))
    close("projection_matrix", matrix("projection_matrix"), np.hstack([k, np.zeros((3, 1))]))
    equal("binning", (document["binning_x"], document["binning_y"]), (0, 0))
    equal("roi", document["roi"], {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False})


def load_yaml(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def check_frames(parameters, case):
    keys = ["robot_base_frame", "robot_effector_frame", "tracking_base_frame", "tracking_marker_frame"]
    names = case.names
    expected = [names["base_frame"], names["effector_frame"], case.published_child, names["target_frame"]]
    equal("frames", [parameters[key] for key in keys], expected)


def check_easy_handeye2(path, case):
    document = load_yaml(path)
    parameters, transform = document["parameters"], document["transform"]
    equal("calibration_type", parameters["calibration_type"], "eye_in_hand" if case.in_hand else "eye_on_base")
    equal("name and file", f"{parameters['name']}.calib", path.name)
    assert parameters["freehand_robot_movement"] is True
    check_frames(parameters, case)
    rotation = unit([transform["rotation"][k] for k in "xyzw"])
    close("transform", matrix_of([transform["translation"][k] for k in "xyz"], rotation), case.published)


def check_easy_handeye(path, case):
    def parameters_of(  # HandeyeCalibrationParameters.__init__: any other key is an error
        namespace, move_group_namespace, move_group, eye_on_hand, robot_base_frame, robot_effector_frame,
        tracking_base_frame, tracking_marker_frame, freehand_robot_movement,
    ):
        return locals()

    document = load_yaml(path)
    parameters = parameters_of(**document["parameters"])
    assert parameters["eye_on_hand"] is case.in_hand
    equal("file", path.name, parameters["namespace"].rstrip("/").split("/")[-1] + ".yaml")
    check_frames(parameters, case)
    t = document["transformation"]
    rotation = unit([t["qx"], t["qy"], t["qz"], t["qw"]])
    close("transformation", matrix_of([t["x"], t["y"], t["z"]], rotation), case.published)


def check_ros_tf(path, case):
    document = load_yaml(path)
    equal("frames", (document["header"]["frame_id"], document["child_frame_id"]), (case.parent, case.published_child))
    equal("stamp", document["header"]["stamp"], {"sec": 0, "nanosec": 0})
    transform = document["transform"]
    rotation = unit([transform["rotation"][k] for k in "xyzw"])
    close("transform", matrix_of([transform["translation"][k] for k in "xyz"], rotation), case.published)


def publisher(arguments):
    """`parse_args` of static_transform_publisher: frames and transform of its arguments."""
    flags, positions, at = {}, [], 0
    while at < len(arguments):
        if arguments[at].startswith("--"):
            flags[arguments[at][2:]] = arguments[at + 1]
            at += 2
        else:
            positions.append(arguments[at])
            at += 1
    if flags:
        assert not positions, "flags and positions"
        xyz, xyzw = [float(flags.pop(k)) for k in "xyz"], [float(flags.pop("q" + k)) for k in "xyzw"]
        frames = flags.pop("frame-id"), flags.pop("child-frame-id")
        assert not flags, f"unknown flags {flags}"
        return frames, matrix_of(xyz, unit(xyzw))
    numbers, frames = [float(v) for v in positions[:-2]], tuple(positions[-2:])
    if len(numbers) == 7:
        return frames, matrix_of(numbers[:3], unit(numbers[3:]))
    x, y, z, yaw, pitch, roll = numbers
    return frames, matrix_of_rpy([x, y, z], [roll, pitch, yaw])


def check_static_transform(path, case):
    """A shell runs the script with programs in the place of ROS that print their arguments."""
    older = [line[2:] for line in path.read_text(encoding="utf-8").splitlines() if line.startswith("# ros")]
    equal("commands in comments", len(older), 1)
    with tempfile.TemporaryDirectory() as folder:
        for name in ["ros2", "rosrun"]:
            program = pathlib.Path(folder) / name
            program.write_text('#!/bin/sh\nfor word in "$@"; do echo "$word"; done\n', encoding="utf-8")
            program.chmod(0o755)
        environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}"}

        def words(command):
            out = subprocess.run(["sh", *command], env=environment, check=True, capture_output=True, text=True)
            return out.stdout.split("\n")[:-1]

        for arguments in [words([str(path)]), words(["-c", older[0]])]:
            at = arguments.index("static_transform_publisher")
            arguments, package = arguments[at + 1:], arguments[at - 1]
            if package == "tf":
                equal("period in ms", arguments.pop(), "100")
            frames, transform = publisher(arguments)
            equal("frames", frames, (case.parent, case.published_child))
            close("transform", transform, case.published)


def check_launch(path, case):
    builder = ElementTree.TreeBuilder(insert_comments=True)
    root = ElementTree.parse(path, ElementTree.XMLParser(target=builder)).getroot()
    (node,) = root.findall("node")
    equal("node", (node.get("pkg"), node.get("type")), ("tf2_ros", "static_transform_publisher"))
    frames, transform = publisher(node.get("args").split())
    equal("frames", frames, (case.parent, case.published_child))
    close("transform", transform, case.published)
    (xyz, rpy), = re.findall(r'xyz="(.*?)" rpy="(.*?)"', ElementTree.tostring(root, encoding="unicode"))
    read = matrix_of_rpy([float(v) for v in xyz.split()], [float(v) for v in rpy.split()])
    close("rpy in the comment", read, case.published)


def check_robot(robot, case):
    (joint,) = robot.joints
    equal("joint", (joint.type, joint.parent, joint.child), ("fixed", case.parent, case.published_child))
    close("origin", matrix_of_rpy(joint.origin.xyz, joint.origin.rpy), case.published)
    equal("root of the tree", robot.get_root(), case.parent)


def check_urdf(path, case):
    check_robot(URDF.from_xml_string(path.read_bytes()), case)


def check_xacro(path, case):
    """Included in a description as a user does it."""
    text = path.read_text(encoding="utf-8")
    (name,) = re.findall(r'<xacro:macro name="(\w+)"', text)
    with tempfile.TemporaryDirectory() as folder:
        robot = pathlib.Path(folder) / "robot.urdf.xacro"
        robot.write_text(
            f'<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="{case.parent}"/>'
            f'<xacro:include filename="{path.resolve()}"/><xacro:{name}/></robot>',
            encoding="utf-8",
        )
        check_robot(URDF.from_xml_string(xacro.process_file(str(robot)).toxml().encode()), case)


def check_kalibr(path, case):
    """The checks of CameraParameters in Kalibr's ConfigReader.py."""
    camera, intrinsics = load_yaml(path)["cam0"], case.intrinsics
    equal("camera_model", camera["camera_model"], "pinhole")
    counts = {"radtan": 4, "equidistant": 4, "fov": 1, "none": 0}
    model = camera["distortion_model"]
    equal("coefficients", len(camera["distortion_coeffs"]), counts[model])
    assert all(isinstance(v, float) for v in camera["intrinsics"]) and all(isinstance(v, int) for v in camera["resolution"])
    assert isinstance(camera["rostopic"], str)
    fu, fv, pu, pv = camera["intrinsics"]
    close("intrinsics", [[fu, 0, pu], [0, fv, pv], [0, 0, 1]], case.camera_matrix())
    equal("resolution", camera["resolution"], [intrinsics["width"], intrinsics["height"]])
    names = {"none": "none", "brown_conrady": "radtan", "fisheye": "equidistant"}
    equal("distortion_model", model, names[intrinsics["model"]])
    k3 = [0.0] if model == "radtan" else []
    close("distortion_coeffs", camera["distortion_coeffs"] + k3, intrinsics["distortion"])


def check_mrcal(path, case):
    """As cameramodel.py: a Python literal with these keys, and as many intrinsics as the lens model has."""
    model, intrinsics = ast.literal_eval(path.read_text(encoding="utf-8")), case.intrinsics
    equal("keys", set(model), {"lensmodel", "intrinsics", "extrinsics", "imagersize"})
    names = {"none": ("PINHOLE", 4), "brown_conrady": ("OPENCV5", 9), "rational": ("OPENCV8", 12)}
    name, count = names[intrinsics["model"]]
    equal("lensmodel", model["lensmodel"], f"LENSMODEL_{name}")
    equal("intrinsics", len(model["intrinsics"]), count)
    equal("imagersize", model["imagersize"], [intrinsics["width"], intrinsics["height"]])
    pinhole = [intrinsics[key] for key in ["fx", "fy", "cx", "cy"]]
    close("intrinsics", model["intrinsics"], pinhole + intrinsics["distortion"])
    rt_cam_ref = model["extrinsics"]
    cam_from_ref = matrix_of_vector(rt_cam_ref[3:], rt_cam_ref[:3])
    close("extrinsics", cam_from_ref, np.linalg.inv(case.parent_from_camera))


def check_visp_pose(path, case):
    """As vpArray2D::loadYAML, which reads lines."""
    equal("file", path.name, "eMc.yaml" if case.in_hand else "rMc.yaml")
    shape, values, in_header, start = {}, [], True, None
    for line in path.read_text(encoding="utf-8").splitlines():
        if in_header:
            for key in ["rows", "cols"]:
                if line.startswith(key + ":"):
                    shape[key] = int(line.split()[1])
            in_header = not line.startswith("data:")
        else:
            start = line.index("[") + 1 if start is None else start
            values.append(float(line[start:line.index("]")]))
    equal("shape", (shape["rows"], shape["cols"], len(values)), (6, 1, 6))
    close("pose", matrix_of_vector(values[:3], values[3:]), case.parent_from_camera)


def check_visp_camera(path, case):
    """As vpXmlParserCamera, which takes exactly these elements."""
    camera, = ElementTree.parse(path).getroot()
    equal("camera", [node.tag for node in camera], ["name", "image_width", "image_height", "model"])
    equal("name", camera.findtext("name"), case.names["camera_name"])
    size = (camera.findtext("image_width"), camera.findtext("image_height"))
    equal("size", size, (str(case.intrinsics["width"]), str(case.intrinsics["height"])))
    model = {node.tag: node.text for node in camera.find("model")}
    equal("type", model.pop("type"), "perspectiveProjWithoutDistortion")
    k = {name: float(text) for name, text in model.items()}
    close("model", [[k["px"], 0, k["u0"]], [0, k["py"], k["v0"]], [0, 0, 1]], case.camera_matrix())
    assert not any(case.intrinsics["distortion"]), "the lens has distortion"


def check_zivid(path, case):
    document = load_yaml(path)
    equal("__version__", document["__version__"], {"serializer": 1, "data": 1})
    matrix = np.array(document["FloatMatrix"]["Data"], dtype=float)
    expected = case.parent_from_camera.copy()
    expected[:3, 3] *= 1000.0
    close("matrix in millimetres", matrix, expected)


def check_industrial_calibration(path, case):
    """`decode` of ExtrinsicHandEyeResult; both its ways to a transform."""
    document = load_yaml(path)
    assert document["converged"] is True and np.isnan(document["initial_cost_per_obs"])
    rms = case.result["quality"]["rms_px"]
    # Ceres halves the sum of squares, and there are two residuals per corner.
    close("final_cost_per_obs", document["final_cost_per_obs"], rms * rms / 4)
    target = case.result["target"]
    expected = {
        "camera_mount_to_camera": case.parent_from_camera,
        "target_mount_to_target": matrix_of(target["translation_m"], target["rotation_xyzw"]),
    }
    for key, matrix in expected.items():
        node = document[key]
        rotation = unit([node["qx"], node["qy"], node["qz"], node["qw"]])
        close(key, matrix_of([node[k] for k in "xyz"], rotation), matrix)
        position, rpy = ([document[f"{key}_{part}"][k] for k in "xyz"] for part in ["pos", "rpy"])
        close(f"{key}_rpy", matrix_of_rpy(position, rpy), matrix)


def check_ethz(path, case):
    """`fromJson` of ExtrinsicCalibration."""
    data = json.loads(path.read_text(encoding="utf-8"))
    equal("keys", set(data), {"delay", "rotation", "translation"})
    close("delay", float(data["delay"]), 0.0)
    rotation = unit([float(data["rotation"][k]) for k in "ijkw"])
    close("pose", matrix_of([float(data["translation"][k]) for k in "xyz"], rotation), case.parent_from_camera)


def check_matlab(path, case):
    text = path.read_text(encoding="utf-8")
    variables = {
        name: np.array([[float(v) for v in row.split(",")] for row in rows.split(";")])
        for name, rows in re.findall(r"^(\w+) = \[(.*)\];$", text, re.MULTILINE)
    }
    one_based, intrinsics = case.camera_matrix(), case.intrinsics
    one_based[:2, 2] += 1.0
    close("K", variables["K"], one_based)
    close("imageSize", variables["imageSize"], [[intrinsics["height"], intrinsics["width"]]])
    k1, k2, p1, p2, k3 = case.coefficients()
    close("radialDistortion", variables["radialDistortion"], [[k1, k2, k3]])
    close("tangentialDistortion", variables["tangentialDistortion"], [[p1, p2]])
    close("R", variables["R"], case.parent_from_camera[:3, :3])
    close("t", variables["t"], [case.parent_from_camera[:3, 3]])
    assert "cameraParameters(" in text and "rigidtform3d(R, t)" in text


def check_colmap(path, case):
    """The whole model by pycolmap: poses, and pixels of points by COLMAP's own cameras."""
    model = pycolmap.Reconstruction()
    model.read_text(str(path.parent))
    (camera,) = model.cameras.values()
    equal("size", (camera.width, camera.height), (case.intrinsics["width"], case.intrinsics["height"]))
    # COLMAP's pixels are counted from the corner of the first one, OpenCV's from its centre.
    pixels = [camera.img_from_cam(np.array(point)) for point in POINTS]
    close("pixels", np.array(pixels).reshape(-1, 2) - 0.5, case.pixels(POINTS))
    k = camera.calibration_matrix()
    k[:2, 2] -= 0.5
    close("calibration matrix", k, case.camera_matrix())
    images = {image.name: image for image in model.images.values()}
    equal("images", sorted(images), sorted(view["name"] for view in case.views))
    for view in case.views:
        pose = images[view["name"]].cam_from_world
        pose = pose() if callable(pose) else pose
        camera_from_base = np.vstack([pose.matrix(), [0, 0, 0, 1]])
        close(view["name"], np.linalg.inv(camera_from_base), case.base_from_camera(view))


def check_nerfstudio(path, case):
    """As nerfstudio's dataparser and its way back to OpenCV."""
    data, intrinsics = json.loads(path.read_text(encoding="utf-8")), case.intrinsics
    equal("size", (data["w"], data["h"]), (intrinsics["width"], intrinsics["height"]))
    k = np.array([[data["fl_x"], 0, data["cx"] - 0.5], [0, data["fl_y"], data["cy"] - 0.5], [0, 0, 1]])
    close("camera", k, case.camera_matrix())
    get = lambda names: [data.get(name, 0.0) for name in names.split()]
    orders = {
        "PINHOLE": ("none", ""), "OPENCV": ("brown_conrady", "k1 k2 p1 p2 k3"), "OPENCV_FISHEYE": ("fisheye", "k1 k2 k3 k4"),
    }
    name, order = orders[data["camera_model"]]
    equal("model", name, intrinsics["model"])
    close("distortion", get(order), intrinsics["distortion"])
    equal("images", [frame["file_path"] for frame in data["frames"]], [view["name"] for view in case.views])
    for frame, view in zip(data["frames"], case.views):
        c2w = np.array(frame["transform_matrix"])
        c2w[0:3, 1:3] *= -1
        close(view["name"], c2w, case.base_from_camera(view))


def isometry(said):
    return matrix_of(said["translation"], said["rotation"])


def along_z(axis):
    """The shortest turn that has z along an axis."""
    cross = np.cross([0.0, 0.0, 1.0], axis)
    if np.linalg.norm(cross) < 1e-12:
        return np.eye(4) if axis[2] > 0 else matrix_of_vector(np.zeros(3), [np.pi, 0, 0])
    angle = np.arctan2(np.linalg.norm(cross), axis[2])
    return matrix_of_vector(np.zeros(3), cross / np.linalg.norm(cross) * angle)


def turn_z(angle):
    return matrix_of_rpy(np.zeros(3), [0.0, 0.0, angle])


def corrected_tip(arm, values):
    """base_from_tip of the corrected arm of a result, without compliance: an error stands before the motion of its joint."""
    chain = arm["chain"]
    out = isometry(chain["base_from_first"])
    for joint, errors, value in zip(chain["joints"], arm["joints"], values):
        axis, number = along_z(np.array(joint["axis"])), lambda key, zero: zero if errors[key] is None else errors[key]
        shift, tilt = number("shift_mm", [0.0, 0.0]), number("tilt_deg", [0.0, 0.0])
        error = matrix_of_vector(np.array([*shift, 0.0]) * 1e-3, np.radians([*tilt, number("zero_deg", 0.0)]))
        out = out @ isometry(joint["previous_from_joint"]) @ axis @ error @ turn_z(value) @ np.linalg.inv(axis)
    return out @ isometry(chain["last_from_flange"]) @ isometry(chain["flange_from_tip"])


def configurations(arm):
    """Values for every joint, among them none special."""
    count = len(arm["joints"])
    return [np.zeros(count), *np.random.default_rng(7).uniform(-3.0, 3.0, (5, count))]


def check_arm_urdf(path, case):
    """Links, joints and limits by urdf_parser_py, forward kinematics by Pinocchio."""
    arm, robot = case.result["arm"], URDF.from_xml_string(path.read_bytes())
    equal("root of the tree", robot.get_root(), case.names["base_frame"])
    equal("last link", robot.joints[-1].child, case.names["effector_frame"])
    moving, said = robot.joints[:-1], arm["chain"]["joints"]
    equal("joints", len(moving), len(said))
    equal("type of the last one", robot.joints[-1].type, "fixed")
    for joint, expected in zip(moving, said):
        ends = expected["min"], expected["max"]
        equal("type", joint.type, "continuous" if ends == (None, None) else "revolute")
        if joint.type == "revolute":
            close("limits", [joint.limit.lower, joint.limit.upper], ends)
        assert joint.limit.velocity > 0 and joint.limit.effort > 0
    model = pinocchio.buildModelFromUrdf(str(path))
    data, frame = model.createData(), model.getFrameId(case.names["effector_frame"])
    for values in configurations(arm):
        q = pinocchio.neutral(model)
        for joint, value in zip(moving, values):
            place = model.joints[model.getJointId(joint.name)]
            q[place.idx_q:place.idx_q + place.nq] = [value] if place.nq == 1 else [np.cos(value), np.sin(value)]
        pinocchio.framesForwardKinematics(model, data, q)
        close("tip", data.oMf[frame].homogeneous, corrected_tip(arm, values))


UR_LINKS = ["shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"]
KEYS_OF_SIX = ["x", "y", "z", "roll", "pitch", "yaw"]


def check_ur_kinematics(path, case):
    """As ur_description's ur_macro.xacro reads it and puts links together, behind base_link and its half turn."""
    kinematics, text = load_yaml(path)["kinematics"], path.read_text(encoding="utf-8")
    equal("links", set(kinematics), {*UR_LINKS, "hash"})
    assert re.fullmatch(r"calib_\d+", kinematics["hash"]), kinematics["hash"]
    for link in UR_LINKS:
        equal(link, set(kinematics[link]), set(KEYS_OF_SIX))
        assert all(isinstance(value, float) for value in kinematics[link].values())
    six = lambda numbers: matrix_of_rpy(numbers[:3], numbers[3:])
    around = re.findall(r"^# (?:base|TCP) .*in .*: (-?[0-9].*)$", text, re.MULTILINE)
    base_from_robot, tool0_from_tip = (six([float(value) for value in numbers.split()]) for numbers in around)
    half_turn = turn_z(np.pi)
    for values in configurations(case.result["arm"]):
        base_link_from_link = half_turn
        for link, value in zip(UR_LINKS, values):
            base_link_from_link = base_link_from_link @ six([kinematics[link][k] for k in KEYS_OF_SIX]) @ turn_z(value)
        tip = base_from_robot @ np.linalg.inv(half_turn) @ base_link_from_link @ tool0_from_tip
        close("tip", tip, corrected_tip(case.result["arm"], values))


def check_dh_table(path, case):
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    rows = list(csv.DictReader(lines))
    equal("rows", [row["joint"] for row in rows], ["base", *map(str, range(1, len(rows) - 1)), "tip"])
    for values in configurations(case.result["arm"]):
        tip = np.eye(4)
        for row, value in zip(rows, [0.0, *values, 0.0]):
            a, alpha, d, theta, beta = (float(row[k]) for k in ["a_m", "alpha_rad", "d_m", "theta_offset_rad", "beta_rad"])
            link = matrix_of_rpy([a, 0.0, d], [alpha, 0.0, 0.0]) @ matrix_of_rpy(np.zeros(3), [0.0, beta, 0.0])
            tip = tip @ turn_z(value + theta) @ link
        close("tip", tip, corrected_tip(case.result["arm"], values))


# The first that a name matches.
READERS = {
    "calibration.json": check_json,
    "camera_info.yaml": check_ros_camera_info,
    "opencv.yaml": check_opencv,
    "*.calib": check_easy_handeye2,
    "*_eye_on_*.yaml": check_easy_handeye,
    "static_transform_ros?.sh": check_static_transform,
    "transform_stamped.yaml": check_ros_tf,
    "*_arm.urdf": check_arm_urdf,
    "*_kinematics.yaml": check_ur_kinematics,
    "*_dh.csv": check_dh_table,
    "*.urdf": check_urdf,
    "*.urdf.xacro": check_xacro,
    "*.launch": check_launch,
    "camchain.yaml": check_kalibr,
    "camera.cameramodel": check_mrcal,
    "?Mc.yaml": check_visp_pose,
    "camera.xml": check_visp_camera,
    "hand_eye_transform.yaml": check_zivid,
    "industrial_calibration.yaml": check_industrial_calibration,
    "hand_eye_calibration.json": check_ethz,
    "handeye_calibration.m": check_matlab,
    "images.txt": check_colmap,
    "transforms.json": check_nerfstudio,
}
# Read with images.txt.
BESIDE = {"cameras.txt", "points3D.txt"}


def check_folder(folder, result, context):
    """Number of files, and of those that differ or that nothing reads."""
    case = Case(result, context)
    found = failed = 0
    for path in sorted(folder.iterdir()):
        found += 1
        checks = [check for pattern, check in READERS.items() if path.match(pattern)][:1]
        try:
            if not checks and path.name not in BESIDE:
                raise AssertionError("nothing here reads it")
            for check in checks:
                check(path, case)
            print(f"ok {path.name}")
        except Exception as error:  # noqa: BLE001: whatever a reader says of a file, it is about that file
            failed += 1
            print(f"FAILED {folder.name}/{path.name}: {error!r}")
    return found, failed


def load(path):
    return json.loads(pathlib.Path(path).read_text(encoding="utf-8"))


def main():
    arguments = sys.argv[1:]
    if len(arguments) == 2 and arguments[0] == "--cases":
        cases = [path for path in sorted(pathlib.Path(arguments[1]).iterdir()) if path.is_dir()]
        counts = []
        for case in cases:
            print(f"in {case.name}")
            counts.append(check_folder(case / "exports", load(case / "result.json"), load(case / "context.json")))
    elif len(arguments) in (2, 3):
        context = load(arguments[2]) if len(arguments) == 3 else {}
        counts = [check_folder(pathlib.Path(arguments[0]), load(arguments[1]), context)]
    else:
        sys.exit(__doc__)
    found, failed = (sum(column) for column in zip(*counts)) if counts else (0, 0)
    if found == 0:
        print("no exports")
        sys.exit(2)
    print(f"{found} files read, {failed} failed")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
