"""The Python module beside OpenCV 4's calibrateHandEye, on the same pose pairs.

    pip install ./core/python numpy==2.2.6 opencv-python-headless==4.10.0.84
    OMP_NUM_THREADS=1 python tests/bench/python_pairs.py

Simulates sessions of a camera on a robot's tip that looks at a chessboard of 10 × 7 corners: reported robot poses and corners
have independent noise. From each view's corners cv2.solvePnP makes the pose of the target, with the true lens; these pairs are
what every method gets. The last row of ours has the corners themselves. Prints RMS errors of the camera on the tip over all
sessions and their ratio to ours from the same pairs, in how many sessions ours is nearer, and the processor time of one call,
the median over the sessions, all methods by turns in one run.
"""

import argparse
import os
import sys
import time

os.environ.setdefault('OMP_NUM_THREADS', '1')
import cv2
import handeye
import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'python'))
import simulated

cv2.setNumThreads(1)
PAIRS, CORNERS = 'ours, from the same pairs', 'ours, from the corners'
THEIRS = {f'cv2 {name}': constant for constant, name in enumerate(['Tsai (its default)', 'Park', 'Horaud', 'Andreff',
                                                                   'Daniilidis'])}
ROBOTS = [(0.1, 0.02), (0.5, 0.1)]
BOARD = handeye.Target.chessboard(simulated.COLUMNS, simulated.ROWS, simulated.SQUARE_M)
LENS = handeye.Intrinsics.from_opencv(simulated.MATRIX, None, simulated.SIZE)


def pairs_of(session):
    """In OpenCV's order."""
    robot = session.base_from_tip
    seen = [cv2.solvePnP(simulated.POINTS, corners, simulated.MATRIX, None)[1:] for corners in session.corners]
    return [p[:3, :3] for p in robot], [p[:3, 3:] for p in robot], [cv2.Rodrigues(r)[0] for r, _ in seen], [t for _, t in seen]


def stacked(turns, shifts):
    return np.array([np.vstack([np.hstack([turn, shift]), [0, 0, 0, 1]]) for turn, shift in zip(turns, shifts)])


def methods_on(session):
    """By name: a call that gives tip_from_camera."""
    pairs = pairs_of(session)
    calls = {name: lambda constant=constant: np.hstack(cv2.calibrateHandEye(*pairs, method=constant))
             for name, constant in THEIRS.items()}
    calls['ours, Park'] = lambda: np.hstack(handeye.calibrate_hand_eye(*pairs, method='park'))
    robot, target = stacked(*pairs[:2]), stacked(*pairs[2:])
    calls[PAIRS] = lambda: handeye.calibrate(
        base_from_tip=robot, camera_from_target=target, mode='eye_in_hand').tip_from_camera
    calls[CORNERS] = lambda: handeye.calibrate(corners=session.corners, target=BOARD, base_from_tip=robot, intrinsics=LENS,
                                               mode='eye_in_hand').tip_from_camera
    return calls


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--sessions', type=int, default=200)
    parser.add_argument('--views', type=int, nargs='*', default=[10, 20])
    parser.add_argument('--px', type=float, default=0.1, help='noise of a corner coordinate, pixels')
    parser.add_argument('--seed', type=int, default=1)
    arguments = parser.parse_args()
    print(f'OpenCV {cv2.__version__}, handeye {handeye.__version__}, {arguments.sessions} sessions, {arguments.px} px\n')
    print('| views | robot | method | mm | ° | mm over ours | ° over ours | ours is nearer | ms | of ours |')
    print('|---|---|---|---|---|---|---|---|---|---|')
    for views in arguments.views:
        for robot_mm, robot_deg in ROBOTS:
            rng = np.random.default_rng(arguments.seed)
            errors, times = {}, {}
            for _ in range(arguments.sessions):
                session = simulated.session(rng, views, arguments.px, robot_mm, robot_deg)
                for name, call in methods_on(session).items():
                    began = time.process_time()
                    found = call()
                    times.setdefault(name, []).append(time.process_time() - began)
                    errors.setdefault(name, []).append(simulated.error(found))
            ours, took = np.array(errors[PAIRS]), np.median(times[PAIRS])
            rms = {name: np.sqrt(np.mean(np.square(of), axis=0)) for name, of in errors.items()}
            for name, of in errors.items():
                ratio = rms[name] / rms[PAIRS]
                nearer = '' if name == PAIRS else f'{np.mean(ours[:, 0] < np.array(of)[:, 0]):.0%}'
                took_here = np.median(times[name])
                print(f'| {views} | {robot_mm} mm, {robot_deg}° | {name} | {rms[name][0]:.3f} | {rms[name][1]:.4f} | '
                      f'{ratio[0]:.2f} | {ratio[1]:.2f} | {nearer} | {took_here * 1e3:.2f} | {took_here / took:.2f} |')
            sys.stdout.flush()


if __name__ == '__main__':
    main()
