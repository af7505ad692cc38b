"""How near the truth we and others come from the same corners and robot poses, and whether what is stated covers it.

    cargo build --release -p handeye_app
    cargo build --release --manifest-path tests/bench/peers/Cargo.toml        # the crate vision-calibration
    pip install numpy scipy 'opencv-python-headless<5'                        # 5 has no calibrateHandEye in Python
    apt install python3-mrcal                                                 # optional, Debian; the lens alone
    python -m venv other && other/bin/pip install --pre calibsense            # optional; AGPL, run as a program
    python tests/bench/accuracy.py --ours target/release/handeye \
        --crate tests/bench/peers/target/release/solver_peers --calibsense other/bin/calibsense

Sessions are simulated here, by no code of ours: a lens with distortion, a board of 70 corners before a camera that tilts up to
40° and rolls up to 60°, Gaussian noise of every corner, and Gaussian errors of every reported robot pose, per axis. Session s
has the same geometry and the same noise, scaled, in all cells. Every program gets the corners in single precision and the poses.
With a known lens it is given the true one; otherwise it estimates nine numbers.

A row for each cell and program: RMS over the sessions of the error of the hand-eye link; "above ours" is by how many of its standard
errors over the sessions the squared error in millimetres lies above ours. Of those that state standard deviations, how many of the three
components of the translation are within 1.96 of them (95 % would be right), and the RMS of what is stated over that of the
errors. Of ours, how often the error of a point at the board stays below `tip_error_95_mm`. Where the lens is estimated, RMS
errors of fx and cx, and the same of the stated deviations of fx fy cx cy; the lens of OpenCV and mrcal knows nothing of the robot.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from solvers import CAMERA, DISTORTION, GRID, SIZE, SQUARE_M, board, load, project, quaternion, rotation, transform, transform_of

ROBOTS = {'exact': (0.0, 0.0), '0.1 mm, 0.02°': (1e-4, np.deg2rad(0.02)), '0.5 mm, 0.1°': (5e-4, np.deg2rad(0.1))}
MODES = ('eye_in_hand', 'eye_to_hand')
LENSES = ('known', 'estimated')
MARGIN_PX = 5
# OpenCV's constants, by the names of their authors.
METHODS = ('TSAI', 'PARK', 'HORAUD', 'ANDREFF', 'DANIILIDIS')
TWO_LINKS = ('SHAH', 'LI')


def simulate(seed, mode, views, corner_px, robot):
    """Reported tip poses, corners, and the true hand-eye link: tip_from_camera or base_from_camera."""
    rng = np.random.default_rng([20, seed])
    mount = transform([0.02, -0.01, 1.55] + rng.normal(0, 0.2, 3), [0.03, -0.05, 0.04] + rng.normal(0, 0.02, 3))
    anchor = transform([0.0, 3.1, 0.1] + rng.normal(0, 0.2, 3), [0.5, 0.1, 0.02] + rng.normal(0, 0.1, 3))
    points = board()
    centre = points.mean(axis=0)
    tips, corners = [], []
    while len(tips) < views:
        azimuth = rng.uniform(-np.pi, np.pi)
        tilt = rotation(np.array([np.cos(azimuth), np.sin(azimuth), 0]) * rng.uniform(0.1, 0.7))
        turned = rotation(np.array([0, 0, rng.uniform(-1.05, 1.05)])) @ tilt
        at = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.15, 0.15), 1]) * rng.uniform(0.3, 0.5)
        px = project((points - centre) @ turned.T + at)
        noise, error = rng.normal(0, 1, px.shape), rng.normal(0, 1, 6)
        if np.any(px < MARGIN_PX) or np.any(px > np.array(SIZE) - 1 - MARGIN_PX):
            continue
        camera_from_target = np.eye(4)
        camera_from_target[:3, :3] = turned
        camera_from_target[:3, 3] = at - turned @ centre
        if mode == 'eye_in_hand':
            # anchor is base_from_target, mount tip_from_camera.
            tip = anchor @ np.linalg.inv(camera_from_target) @ np.linalg.inv(mount)
        else:
            # anchor is base_from_camera, mount tip_from_target.
            tip = anchor @ camera_from_target @ np.linalg.inv(mount)
        tips.append(tip @ transform(error[3:] * robot[1], error[:3] * robot[0]))
        corners.append((px + noise * corner_px).astype(np.float32).astype(float))
    return tips, np.array(corners), mount if mode == 'eye_in_hand' else anchor


def write_session(folder, mode, lens, tips, corners):
    """As the format of solver_times, and as a dataset folder."""
    with open(folder + '.txt', 'w') as file:
        print(*SIZE, *GRID, repr(SQUARE_M), file=file)
        for tip, px in zip(tips, corners):
            numbers = [*tip[:3, 3], *quaternion(tip[:3, :3]), *px.ravel()]
            print(' '.join(repr(float(n)) for n in numbers), file=file)
    os.makedirs(folder)
    with open(os.path.join(folder, 'poses.csv'), 'w') as file:
        print('image,x,y,z,qw,qx,qy,qz', file=file)
        for i, tip in enumerate(tips):
            numbers = [*tip[:3, 3], *quaternion(tip[:3, :3])]
            print(f'{i:03}.png,' + ','.join(repr(float(n)) for n in numbers), file=file)
    with open(os.path.join(folder, 'corners.csv'), 'w') as file:
        print('image,column,row,u,v', file=file)
        for i, px in enumerate(corners):
            for j, (u, v) in enumerate(px):
                print(f'{i:03}.png,{j % GRID[0]},{j // GRID[0]},{float(u)!r},{float(v)!r}', file=file)
    given = f'fixed = false\nwidth = {SIZE[0]}\nheight = {SIZE[1]}\nmodel = "brown_conrady"\n'
    if lens == 'known':
        fx, fy, cx, cy = (float(n) for n in CAMERA)
        given = (f'fixed = true\nwidth = {SIZE[0]}\nheight = {SIZE[1]}\nfx = {fx}\nfy = {fy}\ncx = {cx}\ncy = {cy}\n'
                 f'model = "brown_conrady"\ndistortion = {[float(n) for n in DISTORTION]}\n')
    with open(os.path.join(folder, 'dataset.toml'), 'w') as file:
        file.write(f'mode = "{mode}"\n[target]\nkind = "chessboard"\ncolumns = {GRID[0]}\nrows = {GRID[1]}\n'
                   f'square_m = {SQUARE_M}\ncorners = "corners.csv"\n[robot]\nposes = "poses.csv"\nlength_unit = "m"\n'
                   f'rotation = "quaternion_wxyz"\npose = "base_from_tip"\n[camera]\n{given}')


def run(command, **options):
    return subprocess.run(command, capture_output=True, text=True, **options)


def last_line(process):
    return ((process.stderr or process.stdout).strip().splitlines() or [f'ended with {process.returncode}'])[-1][:200]


def ours(program, folder):
    path = folder + '.ours.json'
    done = run([program, 'calibrate', folder, '--quiet', '--json', path])
    if done.returncode != 0:
        return {'missing': last_line(done)}
    with open(path) as file:
        result = json.load(file)
    link, camera, estimate = result['hand_eye'], result['intrinsics'], result['estimate']
    x, y, z, w = link['rotation_xyzw']
    out = {'hand_eye': transform_of(np.array([*link['translation_m'], w, x, y, z])),
           'sigma': np.sqrt(np.diag(link['covariance'])[:3]) if link['covariance'] else None, 'sigma_in': 'child',
           'point': np.array(estimate['reference_point_m']), 'tip_error_95_mm': result['quality']['tip_error_95_mm']}
    if not camera['fixed']:
        out['camera'] = [camera[name] for name in ('fx', 'fy', 'cx', 'cy')]
        out['camera_sigma'] = [camera['sigma'][name] for name in ('fx', 'fy', 'cx', 'cy')]
    return out


def opencv(folder, mode, lens):
    """By method: its hand-eye link; all with the same camera."""
    import cv2
    cv2.setNumThreads(1)
    poses, px = load(folder + '.txt')
    points = board().astype(np.float32)
    images = [view.astype(np.float32) for view in px]
    camera = {}
    if lens == 'known':
        fx, fy, cx, cy = CAMERA
        matrix, distortion = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]), DISTORTION
        seen = [cv2.solvePnP(points, view, matrix, distortion)[1:] for view in images]
    else:
        _, matrix, distortion, rvecs, tvecs, sigma, _, _ = cv2.calibrateCameraExtended(
            [points] * len(images), images, SIZE, None, None)
        seen = list(zip(rvecs, tvecs))
        camera = {'camera': [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]], 'camera_sigma': sigma.ravel()[:4]}
    tips = [transform_of(pose) for pose in poses]
    # Of a camera that stands, the functions take the inverse of the robot's poses.
    anchor_from_mount = tips if mode == 'eye_in_hand' else [np.linalg.inv(tip) for tip in tips]
    turns, places = [cv2.Rodrigues(r)[0] for r, _ in seen], [t for _, t in seen]
    out = {}
    for name in METHODS:
        found = cv2.calibrateHandEye([m[:3, :3] for m in anchor_from_mount], [m[:3, 3] for m in anchor_from_mount], turns, places,
                                     method=getattr(cv2, f'CALIB_HAND_EYE_{name}'))
        out[name] = {'hand_eye': stacked(*found), **camera}
    mount_from_anchor = [np.linalg.inv(m) for m in anchor_from_mount]
    for name in TWO_LINKS:
        found = cv2.calibrateRobotWorldHandEye(
            turns, places, [m[:3, :3] for m in mount_from_anchor], [m[:3, 3] for m in mount_from_anchor],
            method=getattr(cv2, f'CALIB_ROBOT_WORLD_HAND_EYE_{name}'))
        # The second link is camera_from_mount.
        out[name] = {'hand_eye': np.linalg.inv(stacked(*found[2:])), **camera}
    return out


def stacked(turn, place):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = turn, np.ravel(place)
    return out


def of_crate(program, folders, mode, lens):
    given = 'estimate' if lens == 'estimated' else ','.join(repr(float(n)) for n in [*CAMERA, *DISTORTION])
    done = run([program, 'hand-eye', mode, given, *[folder + '.txt' for folder in folders]])
    out = []
    for line in done.stdout.splitlines():
        result = json.loads(line)
        if 'missing' not in result:
            link = np.array(result['hand_eye'])
            # Its link of a camera that stands is camera_from_base.
            result['hand_eye'] = link if mode == 'eye_in_hand' else np.linalg.inv(link)
            result['sigma'] = None if None in result['translation_sigma_m'] else np.array(result['translation_sigma_m'])
            result['sigma_in'] = 'child' if mode == 'eye_in_hand' else 'inverse'
            if lens == 'known':
                del result['camera']
            elif None in result['camera_sigma']:
                result['camera_sigma'] = None
        out.append(result)
    return out or [{'missing': last_line(done)}] * len(folders)


def of_calibsense(program, folder, mode):
    tips, px = load(folder + '.txt')
    names = [f'view{i:04d}' for i in range(len(px))]
    # All lengths in millimetres, which is its unit.
    with open(folder + '.detections.json', 'w') as file:
        json.dump({'format': 'calibsense.detections', 'image_size': SIZE,
                   'target': {'kind': 'checkerboard', 'columns': GRID[0], 'rows': GRID[1], 'square_size': SQUARE_M * 1e3,
                              'units': 'mm'},
                   'views': [{'view_id': name, 'point_ids': list(range(len(view))), 'image_points': view.tolist()}
                             for name, view in zip(names, px)]}, file)
    with open(folder + '.robot.json', 'w') as file:
        json.dump({'format': 'calibsense.robot_poses', 'convention': 'gripper2base', 'units': 'm',
                   'poses': [{'view_id': name, 'matrix': transform_of(pose).tolist()} for name, pose in zip(names, tips)]}, file)
    # It starts from a lens in a file: 3 % off, without distortion.
    with open(folder + '.lens.yaml', 'w') as file:
        fx, fy, cx, cy = (float(n) for n in CAMERA * np.array([1.03, 1.03, 1, 1]))
        file.write(f'image_width: {SIZE[0]}\nimage_height: {SIZE[1]}\ncamera_name: simulated\ncamera_matrix:\n  rows: 3\n  cols: 3\n'
                   f'  data: [{fx}, 0.0, {cx}, 0.0, {fy}, {cy}, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n'
                   f'distortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [0.0, 0.0, 0.0, 0.0, 0.0]\n')
    done = run([program, 'ingest', 'calibration', '--detections', folder + '.detections.json', '--calibration', folder + '.lens.yaml',
                '--calibration-format', 'ros', '--robot-poses', folder + '.robot.json', '--robot-units', 'm', '-o', folder + '.npz'])
    if done.returncode == 0:
        done = run([program, '--deterministic', 'report', folder + '.npz', '--mounting', mode, '--json', folder + '.calibsense.json'])
    # It ends with 3 when a finding is critical, with a report all the same.
    if not os.path.exists(folder + '.calibsense.json'):
        return {'missing': last_line(done)}
    with open(folder + '.calibsense.json') as file:
        return json.load(file)


def read_calibsense(report):
    if 'missing' in report:
        return report
    link = report.get('hand_eye')
    if not link:
        return {'missing': 'no hand-eye link in its report'}
    matrix = np.array(link['camera']['matrix'], float)
    matrix[:3, 3] *= 1e-3
    found = {entry['name']: entry for entry in report['fit']['parameters']}
    return {'hand_eye': matrix, 'sigma': np.array(link['translation_std_mm']).ravel()[:3] * 1e-3, 'sigma_in': 'parent',
            'camera': [found[name]['value'] for name in ('fx', 'fy', 'cx', 'cy')],
            'camera_sigma': [found[name]['std_dev'] for name in ('fx', 'fy', 'cx', 'cy')]}


def lens_of_mrcal(files):
    """Of every file nine numbers and standard deviations of the first four, by the passes of `mrcal-calibrate-cameras`."""
    import mrcal
    for path in files:
        _, px = load(path)
        count = len(px)
        observations = np.ones((count, GRID[1], GRID[0], 3))
        observations[..., :2] = px.reshape(count, GRID[1], GRID[0], 2)
        frames = np.stack([np.arange(count), np.zeros(count)], axis=1).astype(np.int32)
        inputs = {
            'frames_rt_toref': None, 'points': None, 'observations_board': observations,
            'indices_frame_camintrinsics_camextrinsics': np.concatenate([frames, np.full((count, 1), -1)], axis=1).astype(np.int32),
            'observations_point': None, 'indices_point_camintrinsics_camextrinsics': None,
            'imagersizes': np.array([SIZE], dtype=np.int32), 'calibration_object_spacing': SQUARE_M,
            'do_optimize_calobject_warp': False, 'do_apply_outlier_rejection': False, 'do_apply_regularization': False,
            'verbose': False}
        intrinsics, extrinsics, poses = mrcal.seed_stereographic(
            imagersizes=inputs['imagersizes'], focal_estimate=float(max(SIZE)), indices_frame_camera=frames,
            observations=observations, object_spacing=SQUARE_M)
        inputs.update(extrinsics_rt_fromref=extrinsics, frames_rt_toref=poses)
        for core in (False, True):
            mrcal.optimize(intrinsics=intrinsics, lensmodel='LENSMODEL_STEREOGRAPHIC', do_optimize_intrinsics_core=core,
                           do_optimize_intrinsics_distortions=False, **inputs)
        intrinsics = np.concatenate([intrinsics, np.full((1, 5), 1e-8)], axis=1)
        inputs.update(intrinsics=intrinsics, lensmodel='LENSMODEL_OPENCV5', do_optimize_intrinsics_core=True,
                      do_optimize_intrinsics_distortions=True)
        mrcal.optimize(**inputs)
        packed, residuals, jacobian, _ = mrcal.optimizer_callback(**inputs)
        j = jacobian.toarray()
        variance = residuals @ residuals / (len(residuals) - j.shape[1])
        covariance = np.linalg.inv(j.T @ j) * variance
        # In units of its scale of each variable.
        scale = np.ones(j.shape[1])
        mrcal.unpack_state(scale, **inputs)
        sigma = np.sqrt(np.diag(covariance)) * scale
        print(json.dumps({'camera': list(intrinsics[0, :4]), 'camera_sigma': list(sigma[:4])}))


def of_mrcal(python, folders):
    done = run([python, os.path.abspath(__file__), '--mrcal', *[folder + '.txt' for folder in folders]])
    out = [json.loads(line) for line in done.stdout.splitlines()]
    return out if len(out) == len(folders) else [{'missing': last_line(done)}] * len(folders)


def link_errors(result, true):
    """Errors in metres and radians, and of the components of the translation as their deviations are stated."""
    found = result['hand_eye']
    error = np.linalg.inv(found) @ true
    turn = np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1))
    parts = {'child': error[:3, 3], 'inverse': (found @ np.linalg.inv(true))[:3, 3], 'parent': (true - found)[:3, 3]}
    return np.linalg.norm(true[:3, 3] - found[:3, 3]), turn, parts.get(result.get('sigma_in'))


def share(values):
    return f'{100 * np.mean(values):.0f} %' if len(values) else ''


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def above(results, ours, truths):
    """Of squared errors of the translation, where both have an answer; empty for ours itself."""
    pairs = [(link_errors(r, t)[0]**2, link_errors(o, t)[0]**2) for r, o, t in zip(results, ours, truths)
             if 'hand_eye' in r and 'hand_eye' in o]
    differences = np.array([theirs - our for theirs, our in pairs])
    if results is ours or len(differences) < 2:
        return ''
    return f'{differences.mean() / (differences.std(ddof=1) / np.sqrt(len(differences))):+.1f}'


def hand_eye_cells(results, ours, truths):
    moved, turned, within, stated, errors, tip = [], [], [], [], [], []
    for result, true in zip(results, truths):
        if 'hand_eye' not in result:
            continue
        translation, turn, parts = link_errors(result, true)
        moved.append(translation)
        turned.append(turn)
        if result.get('sigma') is not None:
            within.extend(np.abs(parts) <= 1.96 * result['sigma'])
            stated.extend(result['sigma'])
            errors.extend(parts)
        if result.get('tip_error_95_mm') is not None:
            error = np.linalg.inv(result['hand_eye']) @ true
            point = result['point']
            tip.append(np.linalg.norm(error[:3, :3] @ point + error[:3, 3] - point) * 1e3 <= result['tip_error_95_mm'])
    if not moved:
        return ' |' * 5
    ratio = f'{rms(stated) / rms(errors):.2f}' if stated else ''
    return (f'{rms(moved) * 1e3:.3f} | {np.rad2deg(rms(turned)):.4f} | {above(results, ours, truths)} | {share(within)} | {ratio} | {share(tip)}')


def lens_cells(results):
    known = [r for r in results if 'camera' in r]
    if not known:
        return ' | | |'
    errors = np.array([np.array(r['camera']) - CAMERA for r in known])
    stated = [(np.array(r['camera']) - CAMERA, np.array(r['camera_sigma'])) for r in known if r.get('camera_sigma') is not None]
    within = [np.abs(error) <= 1.96 * sigma for error, sigma in stated]
    ratio = f'{rms([s[0] for _, s in stated]) / rms([e[0] for e, _ in stated]):.2f}' if stated else ''
    return (f'{rms(errors[:, 0]):.3f} | {rms(errors[:, 2]):.3f} | {share(np.array(within).ravel())} | {ratio}')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--ours', help='the built handeye')
    parser.add_argument('--crate', help='the built solver_peers')
    parser.add_argument('--calibsense', help='the program of that name, which takes seconds for a session')
    parser.add_argument('--mrcal-python', default='/usr/bin/python3', help='a Python that has mrcal; empty for none')
    parser.add_argument('--sessions', type=int, default=30)
    parser.add_argument('--views', type=int, nargs='+', default=[10, 20])
    parser.add_argument('--corner-px', type=float, nargs='+', default=[0.1, 0.3])
    parser.add_argument('--modes', nargs='+', choices=MODES, default=MODES)
    parser.add_argument('--lenses', nargs='+', choices=LENSES, default=LENSES)
    parser.add_argument('--jobs', type=int, default=1, help='processes of ours and of calibsense at a time')
    parser.add_argument('--keep', help='a new folder for the sessions and what the programs answered')
    parser.add_argument('--mrcal', nargs='+', help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.mrcal:
        lens_of_mrcal(arguments.mrcal)
        return
    if not arguments.ours:
        parser.error('--ours is needed')
    print('| mounting | lens | views | px | robot | program | mm | ° | above ours | within 1.96 σ | stated/actual | tip within 95 % '
          '| fx px | cx px | lens within 1.96 σ | stated/actual fx | answers |')
    print('|---' * 17 + '|', flush=True)
    cells = [(mode, lens, views, px, robot) for lens in arguments.lenses for mode in arguments.modes for views in arguments.views
             for px in arguments.corner_px for robot in ROBOTS]
    for number, cell in enumerate(cells):
        with tempfile.TemporaryDirectory() as temporary:
            results, truths = solve_cell(arguments, cell, os.path.join(arguments.keep or temporary, f'{number:02}'))
        head = ' | '.join(str(part) for part in cell)
        for name, of in results.items():
            print(f'| {head} | {name} | {hand_eye_cells(of, results["ours"], truths)} | {lens_cells(of)} | '
                  f'{sum("missing" not in r for r in of)} of {len(of)} |', flush=True)
            why = sorted({r['missing'] for r in of if 'missing' in r})
            if why:
                print(f'{name} has no answer in {sum("missing" in r for r in of)} sessions: {"; ".join(why)[:400]}', file=sys.stderr)


def solve_cell(arguments, cell, folder):
    """Results of each program, and the true links."""
    mode, lens, views, px, robot = cell
    os.makedirs(folder)
    folders, truths = [], []
    for session in range(arguments.sessions):
        tips, corners, true = simulate(session, mode, views, px, ROBOTS[robot])
        folders.append(os.path.join(folder, f'{session:03}'))
        truths.append(true)
        write_session(folders[-1], mode, lens, tips, corners)
    results = {}
    with ThreadPoolExecutor(arguments.jobs) as pool:
        results['ours'] = list(pool.map(lambda f: ours(arguments.ours, f), folders))
        by_method = [opencv(f, mode, lens) for f in folders]
        all_methods = {name: [of[name] for of in by_method] for name in (*METHODS, *TWO_LINKS)}
        results['OpenCV (Tsai, its default)'] = all_methods['TSAI']
        best = min(all_methods, key=lambda name: rms([link_errors(r, t)[0] for r, t in zip(all_methods[name], truths)]))
        # The same camera as that of the row above.
        results[f'OpenCV ({best.capitalize()}, its best here)'] = [{'hand_eye': r['hand_eye']} for r in all_methods[best]]
        if arguments.crate:
            results['vision-calibration'] = of_crate(arguments.crate, folders, mode, lens)
        # It takes no lens as known: something of it has to be free.
        if arguments.calibsense and lens == 'estimated':
            reports = pool.map(lambda f: of_calibsense(arguments.calibsense, f, mode), folders)
            results['calibsense'] = [read_calibsense(report) for report in reports]
    # The robot's poses are nothing to it.
    if arguments.mrcal_python and lens == 'estimated' and robot == 'exact':
        results['mrcal'] = of_mrcal(arguments.mrcal_python, folders)
    return results, truths


if __name__ == '__main__':
    main()
