"""Records a robot that never rests, with a camera in its hand whose clock is behind, as a bag of ROS 2.

The images are of a chessboard of 8 x 6 inner corners, 25 mm apart, drawn by OpenCV as a camera without distortion sees it. The
stamps of images are early by OFFSET_S: the robot's pose of an image is that at its stamp and OFFSET_S. Prints as JSON what was
recorded: tip_from_camera, the offset, and base_from_tip by the stamp of the image.

usage: write_moving_bag.py BAG
"""

import json
import sys
from pathlib import Path

import cv2
import numpy as np

from bags import Bag

SECONDS, ROBOT_HZ, CAMERA_HZ = 16.0, 100, 15
OFFSET_S = 0.0437
START_NS = 1_700_000_000 * 10**9
SQUARE_M, COLUMNS, ROWS = 0.025, 8, 6
PIXELS = 40
NOISE = 3.0
K = np.array([[620.0, 0, 318], [0, 615.0, 243], [0, 0, 1]])


def pose(rotation, translation):
    m = np.eye(4)
    m[:3, :3] = cv2.Rodrigues(np.array(rotation, dtype=float))[0]
    m[:3, 3] = translation
    return m


tip_from_camera = pose([0.02, -0.03, 1.2], [0.03, -0.06, 0.09])
# The board lies before the robot; the camera looks down at its middle.
base_from_board = pose([0.05, -0.1, 0.3], [0.5, 0.05, 0.02])
middle = np.array([(COLUMNS - 1) * SQUARE_M / 2, (ROWS - 1) * SQUARE_M / 2, 0])


def wave(t, axis):
    return sum(np.sin((0.6 + 0.41 * k + 0.17 * axis) * t + axis) for k in range(3)) / 3


def base_from_tip(t):
    """Smooth, never at rest, not periodic, turning about every axis."""
    turn = [np.pi + 0.45 * wave(t, 0), 0.45 * wave(t, 1), 0.5 * wave(t, 2)]
    about = [pose(np.eye(3)[axis] * turn[axis], [0, 0, 0]) for axis in range(3)]
    board_from_camera = about[0] @ about[1] @ about[2]
    away = 0.42 + 0.06 * wave(t, 3)
    aside = np.array([0.03 * wave(t, 4), 0.03 * wave(t, 5), 0])
    board_from_camera[:3, 3] = middle + aside - board_from_camera[:3, 2] * away
    return base_from_board @ board_from_camera @ np.linalg.inv(tip_from_camera)


def board():
    """The printed board, a square wide of white around it."""
    image = np.full(((ROWS + 3) * PIXELS, (COLUMNS + 3) * PIXELS), 235, np.uint8)
    for row in range(ROWS + 1):
        for column in range(COLUMNS + 1):
            if (row + column) % 2 == 0:
                image[(row + 1) * PIXELS : (row + 2) * PIXELS, (column + 1) * PIXELS : (column + 2) * PIXELS] = 30
    return image


def seen(t, printed, random):
    camera_from_board = np.linalg.inv(base_from_tip(t) @ tip_from_camera) @ base_from_board
    # A pixel's middle is at whole numbers; the first inner corner lies between two of them.
    metres = SQUARE_M / PIXELS
    board_from_print = np.diag([metres, metres, 1])
    board_from_print[:2, 2] = (0.5 - 2 * PIXELS) * metres
    homography = K @ camera_from_board[:3, [0, 1, 3]] @ board_from_print
    size, finer = (640, 480), np.diag([3.0, 3.0, 1.0])
    finer[:2, 2] = 1.0
    large = cv2.warpPerspective(printed, finer @ homography, (3 * size[0], 3 * size[1]), borderValue=110)
    image = cv2.resize(large, size, interpolation=cv2.INTER_AREA)
    image = np.clip(np.round(image + random.normal(0, NOISE, image.shape)), 0, 255).astype(np.uint8)
    return cv2.imencode(".png", image)[1].tobytes()


recorded = {}
with Bag(Path(sys.argv[1]), "mcap") as bag:
    printed, random = board(), np.random.default_rng(5)
    events = [(k / ROBOT_HZ, "robot") for k in range(int(SECONDS * ROBOT_HZ))]
    events += [(k / CAMERA_HZ, "camera") for k in range(int(SECONDS * CAMERA_HZ))]
    for t, who in sorted(events):
        time = START_NS + round(t * 1e9)
        if who == "robot":
            bag.transform("/tf", time, "base_link", "tool0", base_from_tip(t))
        else:
            stamp = time - round(OFFSET_S * 1e9)
            bag.image("/camera/image/compressed", stamp, seen(t, printed, random), "png", recorded=time)
            recorded[str(stamp)] = base_from_tip(t).tolist()
print(json.dumps({"tip_from_camera": tip_from_camera.tolist(), "offset_s": OFFSET_S, "base_from_tip": recorded}))
