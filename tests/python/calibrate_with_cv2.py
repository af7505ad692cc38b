"""The calibration that people write by hand: official client, OpenCV corners, calibrateCamera, calibrateHandEye.

Drives a cell (built-in or CoppeliaSim) through taught poses and prints the result as JSON. The end-to-end tests compare
it with what `handeye auto` finds on the same cell.

usage: calibrate_with_cv2.py PORT POSES.toml
"""

import json
import sys
import tomllib

import cv2
import numpy as np
from coppeliasim_zmqremoteapi_client import RemoteAPIClient

COLUMNS, ROWS, SQUARE_M = 10, 7, 0.015


def rgb_image(sim, camera):
    data, (width, height) = sim.getVisionSensorImg(camera)
    image = np.frombuffer(data, np.uint8).reshape(height, width, 3)
    return cv2.cvtColor(np.flipud(image).copy(), cv2.COLOR_RGB2GRAY)


def corners_in(image):
    found, corners = cv2.findChessboardCorners(image, (COLUMNS, ROWS))
    if not found:
        return None
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-6)
    corners = cv2.cornerSubPix(image, corners, (5, 5), (-1, -1), criteria).reshape(-1, 2)
    # The same end of the board in every view: the square behind the first corner's diagonal neighbour is dark.
    grid = corners.reshape(ROWS, COLUMNS, 2)
    inside = grid[:2, :2].reshape(4, 2).mean(axis=0)
    beside = grid[:2, 1:3].reshape(4, 2).mean(axis=0)
    brightness = [float(image[int(round(p[1])), int(round(p[0]))]) for p in (inside, beside)]
    return corners if brightness[0] < brightness[1] else corners[::-1].copy()


def matrix_of(twelve):
    return np.vstack([np.array(twelve).reshape(3, 4), [0, 0, 0, 1]])


def main():
    port, poses_file = int(sys.argv[1]), sys.argv[2]
    with open(poses_file, "rb") as file:
        taught = tomllib.load(file)
    sim = RemoteAPIClient(port=port).require("sim")
    sim.setBoolParam(sim.boolparam_realtime_simulation, False)
    joints = [sim.getObject("/UR5/joint", {"index": i}) for i in range(6)]
    tip, target = sim.getObject("/UR5/Tip"), sim.getObject("/UR5/Target")
    camera = sim.getObject("/UR5/3D_camera")
    sim.startSimulation()
    degrees = np.pi / 180
    sim.moveToConfig({
        "joints": joints,
        "targetPos": [a * degrees for a in taught["start_joints_deg"]],
        "maxVel": 6 * [310 * degrees],
        "maxAccel": 6 * [100 * degrees],
        "maxJerk": 6 * [80 * degrees],
    })
    board = np.zeros((COLUMNS * ROWS, 3), np.float32)
    board[:, :2] = np.mgrid[0:COLUMNS, 0:ROWS].T.reshape(-1, 2) * SQUARE_M
    image_points, tips, size = [], [], None
    for pose in taught["pose"]:
        goal = pose["base_from_tip"]
        sim.moveToPose({
            "ik": {"tip": tip, "target": target},
            "targetPose": goal["translation_m"] + goal["rotation_xyzw"],
            "maxVel": 4 * [30.0],
            "maxAccel": 4 * [1.0],
            "maxJerk": 4 * [1.0],
        })
        image = rgb_image(sim, camera)
        size = image.shape[::-1]
        corners = corners_in(image)
        if corners is None:
            raise SystemExit(f"no board at pose {pose['name']}")
        image_points.append(corners.astype(np.float32))
        tips.append(matrix_of(sim.getObjectMatrix(tip)))
    sim.stopSimulation()
    rms, k, distortion, rvecs, tvecs = cv2.calibrateCamera(
        [board] * len(image_points), image_points, size, None, None
    )
    x = cv2.calibrateHandEye(
        [t[:3, :3] for t in tips],
        [t[:3, 3] for t in tips],
        [cv2.Rodrigues(r)[0] for r in rvecs],
        tvecs,
        method=cv2.CALIB_HAND_EYE_TSAI,
    )
    print(json.dumps({
        "rms_px": rms,
        "fx": k[0, 0],
        "rotation": np.asarray(x[0]).tolist(),
        "translation_m": np.asarray(x[1]).ravel().tolist(),
    }))


if __name__ == "__main__":
    main()
