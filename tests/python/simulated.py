"""Sessions of which the truth is known: a camera on a robot's tip, a chessboard, corners with noise and reported poses."""

import os
from dataclasses import dataclass

import numpy as np

COLUMNS, ROWS, SQUARE_M = 10, 7, 0.015
SIZE = (640, 480)
MATRIX = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
ROW, COLUMN = np.divmod(np.arange(COLUMNS * ROWS), COLUMNS)
POINTS = np.stack([COLUMN * SQUARE_M, ROW * SQUARE_M, np.zeros(COLUMNS * ROWS)], axis=1)


def rotation(vector):
    """(3, 3) of a rotation vector."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle if angle > 0 else vector
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * (k @ k)


def pose(vector, translation):
    out = np.eye(4)
    out[:3, :3] = rotation(np.asarray(vector, dtype=float))
    out[:3, 3] = translation
    return out


def inverse(transform):
    out = np.eye(4)
    out[:3, :3] = transform[:3, :3].T
    out[:3, 3] = -transform[:3, :3].T @ transform[:3, 3]
    return out


def angle_deg(a, b):
    """Between two rotations; good for small angles too."""
    return np.degrees(2 * np.arcsin(min(np.linalg.norm(a[:3, :3] - b[:3, :3]) / np.sqrt(8), 1)))


TIP_FROM_CAMERA = pose([0.2, -0.1, 1.5], [0.05, -0.03, 0.08])
BASE_FROM_TARGET = pose([3.0, 0.2, 0.1], [0.5, 0.1, 0.02])


@dataclass
class Session:
    """Transforms are (N, 4, 4)."""

    base_from_tip: np.ndarray
    """As reported."""
    camera_from_target: np.ndarray
    """The true ones."""
    corners: list
    """(70, 2) each."""


def looks(rng, views):
    """camera_from_target: tilted by up to 35°, turned by up to 60°, from 0.4 to 0.6 m."""
    out = []
    for _ in range(views):
        tilt, azimuth = np.radians(35) * np.sqrt(rng.random()), rng.uniform(0, 2 * np.pi)
        turn = rotation(np.array([tilt * np.cos(azimuth), tilt * np.sin(azimuth), 0.0]))
        turn = turn @ rotation(np.array([0.0, 0.0, np.radians(rng.uniform(-60, 60))]))
        middle = np.array([*rng.uniform(-0.03, 0.03, 2), rng.uniform(0.4, 0.6)])
        look = np.eye(4)
        look[:3, :3], look[:3, 3] = turn, middle - turn @ POINTS.mean(axis=0)
        out.append(look)
    return np.array(out)


def session(rng, views, corner_px=0.0, robot_mm=0.0, robot_deg=0.0, camera_from_target=None):
    """Noise per axis."""
    seen = looks(rng, views) if camera_from_target is None else camera_from_target
    reported, corners = [], []
    for look in seen:
        error = pose(rng.normal(size=3) * np.radians(robot_deg), rng.normal(size=3) * robot_mm * 1e-3)
        reported.append(BASE_FROM_TARGET @ inverse(look) @ inverse(TIP_FROM_CAMERA) @ error)
        points = POINTS @ look[:3, :3].T + look[:3, 3]
        pixels = points[:, :2] / points[:, 2:] * MATRIX[0, 0] + MATRIX[:2, 2]
        corners.append(pixels + rng.normal(size=pixels.shape) * corner_px)
    return Session(np.array(reported), seen, corners)


UR5E = np.array([
    [0.0, np.pi / 2, 0.1625, 0.0], [-0.425, 0.0, 0.0, 0.0], [-0.3922, 0.0, 0.0, 0.0],
    [0.0, np.pi / 2, 0.1333, 0.0], [0.0, -np.pi / 2, 0.0997, 0.0], [0.0, 0.0, 0.0996, 0.0],
])
"""a, alpha, d, theta of each joint as the maker has them."""
AT_EASE = np.array([0.2, -1.5, 1.6, -1.7, -1.6, 0.3])


def forward(rows, joints):
    """base_from_tip of an arm by its rows."""
    out = np.eye(4)
    for (a, alpha, d, theta), q in zip(rows, joints):
        out = out @ pose([0, 0, q + theta], [0, 0, d]) @ pose([alpha, 0, 0], [a, 0, 0])
    return out


def inverse_kinematics(rows, wanted, start):
    """Joint values by Newton's method, or None."""
    joints = np.array(start)
    for _ in range(50):
        def off(q):
            there = inverse(forward(rows, q)) @ wanted
            turn = 0.5 * np.array([there[2, 1] - there[1, 2], there[0, 2] - there[2, 0], there[1, 0] - there[0, 1]])
            return np.concatenate([there[:3, 3], turn])

        now = off(joints)
        if np.linalg.norm(now) < 1e-12:
            return joints if np.trace(inverse(forward(rows, joints)) @ wanted) > 3.9 else None
        slope = np.stack([(off(joints + step) - now) / 1e-7 for step in np.eye(6) * 1e-7], axis=1)
        step = np.linalg.lstsq(slope, -now, rcond=1e-6)[0]
        joints = joints + step * min(1.0, 0.5 / np.linalg.norm(step))
    return None


def real_arm(rng, angle_deg=0.1, length_mm=0.3):
    """Rows of an arm that is not quite what its maker says."""
    errors = rng.normal(size=UR5E.shape) * [length_mm * 1e-3, np.radians(angle_deg), length_mm * 1e-3, np.radians(angle_deg)]
    return UR5E + errors


def arm_session(rng, views, rows, corner_px=0.1):
    """A session of an arm with these rows whose controller counts with those of the maker, and its joint values, (N, 6)."""
    reported, seen, joints, corners = [], [], [], []
    while len(joints) < views:
        wanted = BASE_FROM_TARGET @ inverse(looks(rng, 1)[0]) @ inverse(TIP_FROM_CAMERA)
        found = inverse_kinematics(UR5E, wanted, AT_EASE)
        if found is None:
            continue
        look = inverse(TIP_FROM_CAMERA) @ inverse(forward(rows, found)) @ BASE_FROM_TARGET
        points = POINTS @ look[:3, :3].T + look[:3, 3]
        pixels = points[:, :2] / points[:, 2:] * MATRIX[0, 0] + MATRIX[:2, 2]
        if not ((pixels > 5) & (pixels < np.array(SIZE) - 6)).all():
            continue
        joints.append(found)
        reported.append(forward(UR5E, found))
        seen.append(look)
        corners.append(pixels + rng.normal(size=pixels.shape) * corner_px)
    return Session(np.array(reported), np.array(seen), corners), np.array(joints)


def error(tip_from_camera, truth=TIP_FROM_CAMERA):
    """Of a hand-eye transform: millimetres, degrees."""
    return 1e3 * np.linalg.norm(tip_from_camera[:3, 3] - truth[:3, 3]), angle_deg(tip_from_camera, truth)


def write_folder(folder, s, corners=True, images=False, joints=None):
    """The session as a dataset folder (docs/reference/dataset.md): corners, images without a board, or poses of the target."""
    os.makedirs(folder)
    names = [f"images/{i:03}.png" for i in range(len(s.base_from_tip))]
    rows = lambda poses: "".join(
        f"{name}," + ",".join(repr(float(v)) for v in [*p[:3, 3], *p[:3, :3].ravel()]) + "\n" for name, p in zip(names, poses))
    header = "image,x,y,z," + ",".join(f"r{r}{c}" for r in "123" for c in "123") + "\n"
    files = {"poses.csv": header + rows(s.base_from_tip)}
    if joints is not None:
        lines = files["poses.csv"].splitlines()
        columns = [[f"q{i}" for i in range(1, 7)], *([repr(float(v)) for v in q] for q in joints)]
        files["poses.csv"] = "".join(",".join([line, *values]) + "\n" for line, values in zip(lines, columns))
    if corners:
        source = 'corners = "corners.csv"'
        lines = [f"{name},{i % 10},{i // 10},{float(u)!r},{float(v)!r}\n"
                 for name, seen in zip(names, s.corners) for i, (u, v) in enumerate(seen)]
        files["corners.csv"] = "image,column,row,u,v\n" + "".join(lines)
    elif not images:
        source = 'poses = "target_poses.csv"'
        files["target_poses.csv"] = header + rows(s.camera_from_target)
    else:
        source = ""
    files["dataset.toml"] = (
        f'mode = "eye_in_hand"\n[target]\nkind = "chessboard"\ncolumns = 10\nrows = 7\nsquare_m = 0.015\n{source}\n'
        '[robot]\nposes = "poses.csv"\nlength_unit = "m"\nrotation = "matrix"\npose = "base_from_tip"\n')
    if joints is not None:
        files["dataset.toml"] += 'joints = 6\njoint_unit = "rad"\n[robot.arm]\nkind = "ur5e"\n'
    if corners:
        files["dataset.toml"] += "[camera]\nfixed = false\nwidth = 640\nheight = 480\n"
    for name, text in files.items():
        with open(os.path.join(folder, name), "w") as file:
            file.write(text)
    if images:
        import cv2
    for name in names if images else ():
        os.makedirs(os.path.join(folder, "images"), exist_ok=True)
        cv2.imwrite(os.path.join(folder, name), np.zeros((48, 64), np.uint8))
