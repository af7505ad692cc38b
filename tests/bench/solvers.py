"""Our solvers beside those of others, on identical corners, in one run, each on one thread.

    cargo build --release -p handeye_studies --example solver_times
    cargo build --release --manifest-path tests/bench/peers/Cargo.toml        # for the crate vision-calibration
    pip install numpy opencv-python-headless
    apt install mrcal                                                         # optional, Debian
    OMP_NUM_THREADS=1 python tests/bench/solvers.py --ours target/release/examples/solver_times \
        --crate tests/bench/peers/target/release/solver_peers --views 10 100 1000 10000

Simulates views of 70 corners, writes them in single precision (which is what OpenCV takes), and lets every program
estimate fx fy cx cy k1 k2 p1 p2 k3 from them. Prints for each the processor time of the solver alone, the fastest of
--repeats runs (reading the file and starting Python or a process are not in it), the sum of squared residuals against
ours, and the peak memory of its process. The last column is, for us, the whole calibration from corners with covariance
and influence of every view and held-out fits, and for OpenCV `solvePnP` of every view and `calibrateHandEye`. Programs that are not there, or do not answer within --limit seconds, are named with the reason.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time

os.environ.setdefault('OMP_NUM_THREADS', '1')
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')
import numpy as np

SIZE = (640, 480)
GRID = (10, 7)
# A power of two, so that the points of the board are exact in single precision.
SQUARE_M = 1 / 64
CAMERA = np.array([581.0, 579.0, 322.4, 236.1])
DISTORTION = np.array([-0.21, 0.12, 0.001, -0.002, -0.02])
CORNER_NOISE_PX = 0.1
ROBOT_NOISE = (1e-4, 3.5e-4)


def board():
    x, y = np.meshgrid(np.arange(GRID[0]), np.arange(GRID[1]))
    return np.stack([x.ravel(), y.ravel(), np.zeros(GRID[0] * GRID[1])], axis=1) * SQUARE_M


def rotation(vector):
    angle = np.linalg.norm(vector)
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def transform(vector, translation):
    out = np.eye(4)
    out[:3, :3] = rotation(np.asarray(vector, float))
    out[:3, 3] = translation
    return out


def project(points):
    x, y = points[:, 0] / points[:, 2], points[:, 1] / points[:, 2]
    k1, k2, p1, p2, k3 = DISTORTION
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    u = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([CAMERA[0] * u + CAMERA[2], CAMERA[1] * v + CAMERA[3]], axis=1)


def quaternion(m):
    """`w x y z`, by the largest of the four."""
    t = np.array([np.trace(m), m[0, 0], m[1, 1], m[2, 2]])
    q = np.empty(4)
    i = int(np.argmax(t))
    if i == 0:
        q[:] = 1 + t[0], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    else:
        a, b, c = i - 1, i % 3, (i + 1) % 3
        q[0] = m[c, b] - m[b, c]
        q[1 + a] = 1 + 2 * m[a, a] - t[0]
        q[1 + b] = m[a, b] + m[b, a]
        q[1 + c] = m[a, c] + m[c, a]
    return q / np.linalg.norm(q)


def simulate(count, path):
    """An arm with a camera in its hand before a board, tilted up to 40° and rolled up to 60°."""
    rng = np.random.default_rng(5)
    tip_from_camera = transform([0.02, -0.01, 1.55], [0.03, -0.05, 0.04])
    base_from_target = transform([0.0, 3.1, 0.1], [0.5, 0.1, 0.02])
    points = board()
    centre = points.mean(axis=0)
    with open(path, 'w') as file:
        print(*SIZE, *GRID, repr(SQUARE_M), file=file)
        for i in range(count):
            azimuth = 2.4 * i
            tilt = rotation(np.array([np.cos(azimuth), np.sin(azimuth), 0]) * rng.uniform(0.1, 0.7))
            turned = rotation(np.array([0, 0, rng.uniform(-1, 1)])) @ tilt
            at = np.array([rng.uniform(-0.1, 0.1), rng.uniform(-0.08, 0.08), 1]) * rng.uniform(0.3, 0.5)
            camera_from_target = np.eye(4)
            camera_from_target[:3, :3] = turned
            camera_from_target[:3, 3] = at - turned @ centre
            px = project((points - centre) @ turned.T + at) + rng.normal(0, CORNER_NOISE_PX, (len(points), 2))
            error = transform(rng.normal(0, ROBOT_NOISE[1], 3), rng.normal(0, ROBOT_NOISE[0], 3))
            tip = base_from_target @ np.linalg.inv(camera_from_target) @ np.linalg.inv(tip_from_camera) @ error
            numbers = [*tip[:3, 3], *quaternion(tip[:3, :3]), *px.astype(np.float32).astype(float).ravel()]
            print(' '.join(repr(float(n)) for n in numbers), file=file)


def load(path):
    with open(path) as file:
        next(file)
        rows = np.array([np.fromstring(line, sep=' ') for line in file])
    return rows[:, :7], rows[:, 7:].reshape(len(rows), -1, 2)


def fastest(repeats, work):
    best, result = float('inf'), None
    for _ in range(repeats):
        # Processor time, so that whatever else runs on the machine is not in it.
        start = time.process_time()
        out = work()
        seconds = time.process_time() - start
        if seconds < best:
            best, result = seconds, out
    return best, result


def run_opencv(path, repeats):
    import cv2
    cv2.setNumThreads(1)
    poses, px = load(path)
    points = board().astype(np.float32)
    objects, images = [points] * len(px), [view.astype(np.float32) for view in px]
    seconds, (_, matrix, distortion, rvecs, tvecs) = fastest(
        repeats, lambda: cv2.calibrateCamera(objects, images, SIZE, None, None))
    # The RMS that it returns is of single precision.
    cost = sum(np.sum((cv2.projectPoints(board(), r, t, matrix, distortion)[0][:, 0] - view)**2)
               for r, t, view in zip(rvecs, tvecs, px))

    def hand_eye():
        seen = [cv2.solvePnP(points, view, matrix, distortion)[1:] for view in images]
        rotations = [transform_of(pose)[:3, :3] for pose in poses]
        return cv2.calibrateHandEye(rotations, [pose[:3] for pose in poses],
                                    [cv2.Rodrigues(r)[0] for r, _ in seen], [t for _, t in seen],
                                    method=cv2.CALIB_HAND_EYE_PARK)

    out = {'name': f'OpenCV {cv2.__version__}', 'seconds': seconds, 'cost': float(cost),
           'camera': [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], *distortion.ravel()[:5]]}
    # OpenCV 5 has it in no module of the wheel; the pairs of a thousand poses take minutes.
    if len(px) <= 100 and hasattr(cv2, 'calibrateHandEye'):
        out['hand_eye_seconds'] = fastest(repeats, hand_eye)[0]
    return out


def transform_of(pose):
    w, x, y, z = pose[3:]
    vector = np.array([x, y, z])
    length = np.linalg.norm(vector)
    angle = 2 * np.arctan2(length, w)
    return transform(vector * (angle / length if length > 0 else 2.0), pose[:3])


def run_mrcal(path, repeats):
    """The passes of `mrcal-calibrate-cameras`, without outliers, regularisation and board warp."""
    import mrcal
    _, px = load(path)
    count = len(px)
    observations = np.ones((count, GRID[1], GRID[0], 3))
    observations[..., :2] = px.reshape(count, GRID[1], GRID[0], 2)
    frames = np.stack([np.arange(count), np.zeros(count)], axis=1).astype(np.int32)
    indices = np.concatenate([frames, np.full((count, 1), -1)], axis=1).astype(np.int32)
    sizes = np.array([SIZE], dtype=np.int32)

    def optimise(intrinsics, extrinsics, poses, model, core, distortions):
        return mrcal.optimize(intrinsics, extrinsics, poses, None, observations, indices, None, None, model,
                              imagersizes=sizes, do_optimize_intrinsics_core=core,
                              do_optimize_intrinsics_distortions=distortions, do_optimize_calobject_warp=False,
                              calibration_object_spacing=SQUARE_M, do_apply_outlier_rejection=False,
                              do_apply_regularization=False, verbose=False)

    def solve():
        intrinsics, extrinsics, poses = mrcal.seed_stereographic(
            imagersizes=sizes, focal_estimate=float(max(SIZE)), indices_frame_camera=frames,
            observations=observations, object_spacing=SQUARE_M)
        optimise(intrinsics, extrinsics, poses, 'LENSMODEL_STEREOGRAPHIC', False, False)
        optimise(intrinsics, extrinsics, poses, 'LENSMODEL_STEREOGRAPHIC', True, False)
        intrinsics = np.concatenate([intrinsics, np.full((1, 5), 1e-8)], axis=1)
        stats = optimise(intrinsics, extrinsics, poses, 'LENSMODEL_OPENCV5', True, True)
        return intrinsics[0], float(np.sum(stats['x']**2))

    seconds, (camera, cost) = fastest(repeats, solve)
    return {'name': 'mrcal', 'seconds': seconds, 'cost': cost, 'camera': list(camera)}


def child(command, limit):
    """Its JSON with its peak memory in MB, or why there is none."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        out, err = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return {'missing': f'no answer within {limit:.0f} s'}
    except OSError as error:
        return {'missing': str(error)}
    lines = out.strip().splitlines()
    if process.returncode != 0 or not lines:
        return {'missing': (err.strip().splitlines() or [f'ended with {process.returncode}'])[-1][:160]}
    result = json.loads(lines[-1])
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--ours', help='the built example solver_times')
    parser.add_argument('--crate', help='the built solver_peers, for the crate vision-calibration')
    parser.add_argument('--mrcal-python', default='/usr/bin/python3', help='a Python that has mrcal')
    parser.add_argument('--views', type=int, nargs='+', default=[10, 100, 1000, 10000])
    parser.add_argument('--repeats', type=int, default=5)
    parser.add_argument('--limit', type=float, default=300, help='seconds for one program and one number of views')
    parser.add_argument('--run', choices=['opencv', 'mrcal'], help=argparse.SUPPRESS)
    parser.add_argument('--file', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.run:
        result = {'opencv': run_opencv, 'mrcal': run_mrcal}[arguments.run](arguments.file, arguments.repeats)
        result['memory_mb'] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(json.dumps(result))
        return
    if not arguments.ours:
        parser.error('--ours is needed')
    print(f'{"views":>6} {"program":<22} {"ms":>11} {"µs/view":>9} {"× ours":>8} {"cost/ours−1":>12} {"MB":>7}  hand-eye')
    with tempfile.TemporaryDirectory() as folder:
        for count in arguments.views:
            path = os.path.join(folder, f'{count}.txt')
            simulate(count, path)
            # Many views are slow enough to be timed once by the slow ones.
            repeats = str(max(1, min(arguments.repeats, 2000 // count)))
            this = os.path.abspath(__file__)
            programs = [
                ('ours', [arguments.ours, path, str(arguments.repeats)]),
                ('OpenCV', [sys.executable, this, '--run', 'opencv', '--file', path, '--repeats', repeats]),
                ('mrcal', [arguments.mrcal_python, this, '--run', 'mrcal', '--file', path, '--repeats', repeats]),
            ]
            if arguments.crate:
                programs.append(('vision-calibration', [arguments.crate, path, repeats]))
            ours = None
            for name, command in programs:
                result = child(command, arguments.limit)
                if 'missing' in result:
                    print(f'{count:>6} {name:<22} {result["missing"]}', flush=True)
                    continue
                ours = ours or result
                seconds = result['seconds']
                whole = result.get('whole_seconds') or result.get('hand_eye_seconds')
                note = f'{whole * 1e3:.1f} ms' if whole else ''
                memory = f'{result["memory_mb"]:.0f}' if 'memory_mb' in result else ''
                print(f'{count:>6} {result.get("name", name):<22} {seconds * 1e3:>11.2f} {seconds / count * 1e6:>9.1f} '
                      f'{seconds / ours["seconds"]:>8.1f} {result["cost"] / ours["cost"] - 1:>12.1e} {memory:>7}  {note}',
                      flush=True)


if __name__ == '__main__':
    main()
