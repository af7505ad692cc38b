"""The board as people track it by hand: corners, the depth at the first one, camera to tip to base, and the tip sent there.

Drives a cell (built-in or CoppeliaSim) with the official client. Prints where it found the first corner and where the
tip went as JSON. The end-to-end tests compare both with what `handeye track` finds and does on the same cell.

usage: track_board.py PORT RESULT.json
"""

import json
import sys

import cv2
import numpy as np
from coppeliasim_zmqremoteapi_client import RemoteAPIClient

COLUMNS, ROWS, SQUARE_M = 10, 7, 0.015


def matrix(translation, xyzw):
    x, y, z, w = xyzw
    m = np.eye(4)
    m[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    m[:3, 3] = translation
    return m


def main():
    port, calibration = int(sys.argv[1]), json.load(open(sys.argv[2]))
    lens = calibration["intrinsics"]
    camera_matrix = np.array([[lens["fx"], 0, lens["cx"]], [0, lens["fy"], lens["cy"]], [0, 0, 1]])
    distortion = np.array(lens["distortion"], float) if lens["distortion"] else np.zeros(5)
    tip_from_camera = matrix(calibration["hand_eye"]["translation_m"], calibration["hand_eye"]["rotation_xyzw"])

    sim = RemoteAPIClient(port=port).require("sim")
    tip, target = sim.getObject("/UR5/Tip"), sim.getObject("/UR5/Target")
    camera, depth_camera = sim.getObject("/UR5/3D_camera"), sim.getObject("/UR5/3D_camera/depth")

    data, (width, height) = sim.getVisionSensorImg(camera)
    colour = np.flipud(np.frombuffer(data, np.uint8).reshape(height, width, 3))
    image = cv2.cvtColor(colour.copy(), cv2.COLOR_RGB2GRAY)
    data, (width, height) = sim.getVisionSensorDepth(depth_camera, 1)
    depth = np.flipud(np.frombuffer(data, np.float32).reshape(height, width))

    found, corners = cv2.findChessboardCorners(image, (COLUMNS, ROWS))
    assert found, "the board is not in the image"
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-6)
    corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), criteria).reshape(-1, 2)

    u, v = corners[0]
    ray = cv2.undistortPoints(np.array([[[u, v]]]), camera_matrix, distortion).reshape(2)
    z = float(depth[int(round(v)), int(round(u))])
    base_from_tip = np.vstack([np.array(sim.getObjectMatrix(tip, -1)).reshape(3, 4), [0, 0, 0, 1]])
    point = base_from_tip @ tip_from_camera @ np.array([ray[0] * z, ray[1] * z, z, 1.0])

    grid = np.zeros((COLUMNS * ROWS, 3), np.float32)
    grid[:, :2] = np.mgrid[0:COLUMNS, 0:ROWS].T.reshape(-1, 2) * SQUARE_M
    _, rotation, translation = cv2.solvePnP(grid, corners, camera_matrix, distortion)
    camera_from_board = np.eye(4)
    camera_from_board[:3, :3], camera_from_board[:3, 3] = cv2.Rodrigues(rotation)[0], translation.ravel()
    base_from_board = base_from_tip @ tip_from_camera @ camera_from_board
    sim.setObjectMatrix(target, list(base_from_board[:3].ravel()), -1)

    goal = base_from_tip.copy()
    goal[:3, 3] = point[:3]
    sim.moveToPose({
        "ik": {"tip": tip, "target": target},
        "targetPose": sim.matrixToPose(list(goal[:3].ravel())),
        "maxVel": [0.3, 0.3, 0.3, 1.0],
        "maxAccel": [1.0, 1.0, 1.0, 2.0],
        "maxJerk": [10.0, 10.0, 10.0, 10.0],
    })
    print(json.dumps({
        "first_corner_px": [float(u), float(v)],
        "by_depth_m": point[:3].tolist(),
        "by_pnp_m": base_from_board[:3, 3].tolist(),
        "tip_m": sim.getObjectPosition(tip, -1),
    }))


main()
