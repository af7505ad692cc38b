"""Reads the poses of other people's recordings, independently of the importer, and prints them as JSON.

Each reader is given the conventions that the README of the recording states. Prints {key: 4x4 matrix}: base_from_tip in metres
by the name of the image, or by the place in the series where there are no images, with camera_from_target under "target".

usage: read_recordings.py KIND FOLDER
"""

import json
import re
import sys
from pathlib import Path

import numpy as np
import yaml


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)]["xyz".index(axis)]
    m = np.eye(3)
    m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
    return m


def of_vector(v):
    angle = np.linalg.norm(v)
    if angle == 0:
        return np.eye(3)
    x, y, z = np.asarray(v) / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def of_xyzw(q):
    x, y, z, w = np.asarray(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def pose(translation, rotation):
    m = np.eye(4)
    m[:3, :3], m[:3, 3] = rotation, translation
    return m


def exact(m):
    """The matrix with the rotation nearest to the printed one."""
    u, _, v = np.linalg.svd(m[:3, :3])
    return pose(m[:3, 3], u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v)


def table(folder):
    rows = np.loadtxt(folder / "poses.txt", delimiter=",")
    rpy = [turn("z", r[5]) @ turn("y", r[4]) @ turn("x", r[3]) for r in rows]
    return {f"images{i}.jpg": pose(r[:3], m) for i, (r, m) in enumerate(zip(rows, rpy))}, None


def json_per_pose(folder):
    out = {}
    for file in folder.glob("[0-9]*.json"):
        p = json.loads(file.read_text())["pose_flange"]
        out[f"{file.stem}.jpg"] = pose(p[:3], of_vector(p[3:]))
    return out, None


def easy_handeye2(folder, inverse):
    samples = yaml.safe_load(next(folder.glob("*.samples")).read_text())["samples"]

    def read(t):
        return pose([t["translation"][k] for k in "xyz"], of_xyzw([t["rotation"][k] for k in "xyzw"]))

    robot = {str(i): read(s["robot"]) for i, s in enumerate(samples)}
    if inverse:
        robot = {k: np.linalg.inv(m) for k, m in robot.items()}
    return robot, {str(i): read(s["tracking"]) for i, s in enumerate(samples)}


def moveit(folder):
    groups = json.loads((folder / "pose_samples.json").read_text())
    robot = {str(i): exact(np.array(g[0])) for i, g in enumerate(groups)}
    return robot, {str(i): exact(np.array(g[1])) for i, g in enumerate(groups)}


def visp(folder):
    out = {}
    for file in folder.glob("franka_pose_rPe_*.yaml"):
        v = np.array(yaml.safe_load(file.read_text())["data"]).ravel()
        number = re.search(r"(\d+)", file.stem).group(1)
        out[f"franka_image-{number}.png"] = pose(v[:3], of_vector(v[3:]))
    return out, None


def robot_cal_tools(folder):
    out = {}
    for entry in yaml.safe_load((folder / "cal_data.yaml").read_text()):
        p = yaml.safe_load((folder / entry["pose"]).read_text())
        out[Path(entry["image"]).name] = pose([p[k] for k in "xyz"], of_xyzw([p["q" + k] for k in "xyzw"]))
    return out, None


def rows_of_16(folder):
    rows = np.loadtxt(folder / "RobotPosesVec.txt").reshape(-1, 4, 4)
    return {f"{i + 1:02d}.png": exact(m) for i, m in enumerate(rows)}, None


def blocks_in_mm(folder):
    blocks = np.loadtxt(folder / "robot_cali.txt", skiprows=1).reshape(-1, 4, 4)
    blocks[:, :3, 3] *= 1e-3
    return {f"image_{i:03d}.png": np.linalg.inv(exact(m)) for i, m in enumerate(blocks)}, None


KINDS = {
    "table": table,
    "json_per_pose": json_per_pose,
    "easy_handeye2_in_hand": lambda folder: easy_handeye2(folder, False),
    "easy_handeye2_on_base": lambda folder: easy_handeye2(folder, True),
    "moveit": moveit,
    "visp": visp,
    "robot_cal_tools": robot_cal_tools,
    "rows_of_16": rows_of_16,
    "blocks_in_mm": blocks_in_mm,
}


def main():
    robot, target = KINDS[sys.argv[1]](Path(sys.argv[2]))
    listed = {key: m.tolist() for key, m in robot.items()}
    print(json.dumps({"robot": listed, "target": target and {k: m.tolist() for k, m in target.items()}}))


if __name__ == "__main__":
    main()
