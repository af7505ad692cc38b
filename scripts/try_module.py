"""Calibrates with the installed Python module: ten views of a chessboard, drawn here, of which the answer is known.

It needs numpy alone. Ends with an error where the answer is off by more than the noise of the corners explains.
"""

import numpy as np

import handeye


def pose(turn, shift):
    """A 4 × 4 transform from a rotation vector and a translation."""
    angle = np.linalg.norm(turn)
    x, y, z = turn / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    transform = np.eye(4)
    transform[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    transform[:3, 3] = shift
    return transform


def main():
    rng = np.random.default_rng(1)
    target = handeye.Target.chessboard(columns=9, rows=6, square_m=0.025)
    middle = np.array([0.1, 0.0625, 0.0])
    points = np.array([[x * 0.025, y * 0.025, 0.0] for y in range(6) for x in range(9)])
    camera_matrix = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    tip_from_camera = pose(np.array([0.1, -0.2, 1.5]), [0.03, -0.05, 0.06])
    base_from_target = pose(np.array([3.0, 0.1, 0.2]), [0.5, 0.1, 0.02])
    corners, base_from_tip = [], []
    for _ in range(10):
        turn = rng.uniform(-0.5, 0.5, 3) * [1, 1, 2]
        camera_from_target = pose(turn, [0, 0, 0])
        camera_from_target[:3, 3] = rng.uniform(-0.02, 0.02, 3) + [0, 0, 0.45] - camera_from_target[:3, :3] @ middle
        seen = points @ camera_from_target[:3, :3].T + camera_from_target[:3, 3]
        pixels = (seen / seen[:, 2:]) @ camera_matrix.T
        corners.append(pixels[:, :2] + rng.normal(0, 0.05, (len(points), 2)))
        base_from_tip.append(base_from_target @ np.linalg.inv(camera_from_target) @ np.linalg.inv(tip_from_camera))
    found = handeye.calibrate(
        corners=corners,
        target=target,
        base_from_tip=np.array(base_from_tip),
        image_size=(640, 480),
        mode="eye_in_hand",
        intrinsics=handeye.Intrinsics.from_opencv(camera_matrix, np.zeros(5), (640, 480)),
    )
    # What is stated is of points where the board was.
    point = np.array([0, 0, 0.45, 1])
    off_mm = 1e3 * np.linalg.norm((found.tip_from_camera - tip_from_camera) @ point)
    print(f"handeye {handeye.__version__}: a point is {off_mm:.3f} mm off, {found.tip_error_95_mm:.3f} mm stated")
    assert off_mm < 2 * found.tip_error_95_mm, "more than 0.05 px of noise explain"


if __name__ == "__main__":
    main()
