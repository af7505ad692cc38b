"""Ours beside the methods that KinHEC ships, on every track of one of its tiers.

    pip install kinhec ./core/python
    python tests/bench/kinhec_tracks.py --data target/kinhec_smoke

KinHEC is a synthetic benchmark: streams of robot poses and of target poses with known truth. A tier that is not in --data is
generated there by its own command, in about a minute for `smoke`. Every method gets what KinHEC's protocol gives to its
own: the measured poses of the same keyframes. Ours is the Python module, which answers as the command line does.
Where the target poses come from corners, the recipe of the sequence is run again to have those corners, and ours gets them
and the camera too, which the other methods have no use for.

Prints a table for every track: medians and worst errors against truth over the sequences that ours answers, X and Y as in
A X = Y B. Below it what ours says of the others, with the best shipped method there. In how many sequences the truth is in
the 95 % region of the hand-eye link, and of the other link, stands behind the rows of ours; no other method states one.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import warnings

import handeye
import numpy as np
from scipy import stats

from kinhec import benchmark, generator, load_manifest, load_sequence, motions, noise, se3
from kinhec.camera import CAMERAS, TARGETS
from kinhec.config import SequenceConfig

POSES = 'ours'
SCALED = 'ours, unit of the target poses free'
CORNERS = 'ours, from corners'
# Their x runs along columns, y along rows, z to the viewer, origin in the middle; ours has z into the board and the origin in
# a corner, so our rows run against theirs.
TURN = np.diag([1.0, -1.0, -1.0, 1.0])


def generate(tier, data):
    if os.path.exists(os.path.join(data, 'sequences.parquet')):
        return
    command = [sys.executable, '-m', 'kinhec', 'generate', '--tier', tier, '--out', os.path.abspath(data)]
    # It writes logs and looks for tiers where it is started.
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def keyframes(sequence, offset):
    """Indices of frames, and robot and target poses, as KinHEC's protocol takes them."""
    robot, target, valid = sequence.paired_measurements(offset)
    frames = np.flatnonzero(valid)
    chosen = motions.select_keyframes(robot[frames], benchmark.KEYFRAME_MIN_ROT_DEG, benchmark.KEYFRAME_MIN_TRANS_M,
                                      benchmark.MAX_KEYFRAMES)
    if len(chosen) >= 3:
        frames = frames[chosen]
    return frames, robot[frames], target[frames]


def corners_of(sequence):
    """Pixels of every frame, from which the measured target poses are: the recipe again, as the optimiser is called."""
    seen, refine = [], noise.refine_pose_lm

    def record(camera, points, pixels, start):
        pose, rmse, steps = refine(camera, points, pixels, start)
        seen.append((pose, pixels))
        return pose, rmse, steps

    noise.refine_pose_lm = record
    try:
        generator.generate_sequence(SequenceConfig(**json.loads(sequence.manifest['config_json'])))
    finally:
        noise.refine_pose_lm = refine
    measured = sequence.camera.T_cam_target_meas
    frames = np.flatnonzero(np.isfinite(measured).all(axis=(1, 2)))
    # An attempt at a trajectory may have been thrown away; the last calls are those of the sequence.
    pixels = {}
    for frame, (pose, px) in zip(frames, seen[len(seen) - len(frames):]):
        if not np.allclose(pose, measured[frame], atol=1e-6):
            raise RuntimeError(f'{sequence.id}: the recipe gave other poses than the stored ones')
        pixels[int(frame)] = px
    return pixels


def board_of(sequence):
    board = TARGETS[sequence.manifest['target']]
    return board, handeye.Target.chessboard(board.cols, board.rows, board.spacing_m)


def views_of(sequence, frames, robot):
    """What ours is told in either way."""
    mode = 'eye_in_hand' if sequence.eye_in_hand else 'eye_to_hand'
    names = [f'{frame:05}.png' for frame in frames]
    return {'base_from_tip': robot, 'mode': mode, 'names': names, 'target': board_of(sequence)[1]}


def seen_in(sequence, frames, pixels):
    """Corners in the images, with the camera; our rows run against theirs."""
    board, camera = TARGETS[sequence.manifest['target']], CAMERAS[sequence.manifest['camera']]
    row, column = np.divmod(np.arange(board.cols * board.rows), board.cols)
    ours = (board.rows - 1 - row) * board.cols + column
    corners, ids = [], []
    for frame in frames:
        px = pixels[int(frame)]
        inside = ((px >= 0) & (px <= [camera.width - 1, camera.height - 1])).all(axis=1)
        corners.append(px[inside])
        ids.append(ours[inside])
    lens = handeye.Intrinsics(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy)
    return {'corners': corners, 'corner_ids': ids, 'intrinsics': lens}


def transform(link):
    x, y, z, w = link['rotation_xyzw']
    return se3.pq_to_pose(np.array([*link['translation_m'], w, x, y, z]))


def inside(link, estimate, true):
    """Whether the truth is in the stated 95 % region; `None` without one."""
    if link['covariance'] is None:
        return None
    error = se3.inverse(transform(link)) @ true
    turn_first = se3.log_se3(error)
    delta = np.concatenate([turn_first[3:], turn_first[:3]])
    limit = stats.chi2.ppf(0.95, 6)
    scale = 1.0
    if estimate and estimate.get('region_scale') is not None:
        scale = estimate['region_scale']
        if estimate['degrees_of_freedom'] is not None:
            limit = 6 * stats.f.ppf(0.95, 6, estimate['degrees_of_freedom'])
    return bool(delta @ np.linalg.solve(np.array(link['covariance']) * scale, delta) <= limit)


def calibrate(**arguments):
    """Its result document, or why there is none."""
    try:
        return handeye.calibrate(**arguments).document, None
    except handeye.HandeyeError as error:
        return None, f'error: {error}'


def compared(sequence, result, from_corners):
    """Errors and coverage of a result."""
    hand_eye, target = transform(result['hand_eye']), transform(result['target'])
    true_x, true_y = sequence.X, sequence.Y
    if from_corners:
        # The board frame of ours: rows against theirs, origin in the first corner.
        board = TARGETS[sequence.manifest['target']]
        theirs_from_ours = TURN.copy()
        theirs_from_ours[:2, 3] = np.array([-(board.cols - 1), board.rows - 1]) / 2 * board.spacing_m
        if sequence.eye_in_hand:
            true_y = true_y @ theirs_from_ours
        else:
            true_x = true_x @ theirs_from_ours
    x, y = (hand_eye, target) if sequence.eye_in_hand else (target, hand_eye)
    links = (true_x, true_y) if sequence.eye_in_hand else (true_y, true_x)
    return {'x': se3.pose_error(x, true_x), 'y': se3.pose_error(y, true_y),
            'inside': [inside(result[name], result['estimate'], true) if name == 'hand_eye' or not from_corners
                       else inside(result[name], None, true) for name, true in zip(('hand_eye', 'target'), links)]}


def offset_of(sequence):
    """Ours of the clocks of a sequence, in KinHEC's sign."""
    camera = sequence.camera.T_cam_target_meas
    seen = np.isfinite(camera).all(axis=(1, 2))
    found = handeye.clock_offset(sequence.robot.t, sequence.robot.T_base_ee_meas, sequence.camera.t[seen], camera[seen],
                                 mode='eye_in_hand' if sequence.eye_in_hand else 'eye_to_hand')
    return found


def ours_on(sequence, offset):
    """By name: errors, or a sentence."""
    frames, robot, target = keyframes(sequence, offset)
    views = views_of(sequence, frames, robot)
    result, why = calibrate(camera_from_target=target, **views)
    if result is None:
        return {POSES: why}
    out = {POSES: compared(sequence, result, False)}
    result, why = calibrate(camera_from_target=target, free_scale=True, **views)
    out[SCALED] = why if result is None else compared(sequence, result, False)
    # Outliers of KinHEC are put into the target poses, not into the corners.
    if sequence.manifest['camera_noise_model'] == 'pnp' and sequence.manifest['outlier_fraction'] == 0:
        result, why = calibrate(**views, **seen_in(sequence, frames, corners_of(sequence)))
        out[CORNERS] = why if result is None else compared(sequence, result, True)
    return out


def theirs_on(sequence, sync):
    out = {}
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        rows = benchmark.evaluate_sequence(sequence, list(benchmark.SOLVERS), sync=sync, rng=np.random.default_rng(0))
    for row in rows:
        if not row['ok']:
            out[row['solver']] = row['error'] or 'no finite answer'
            continue
        both = 'Y_rot_err_deg' in row and np.isfinite(row['Y_rot_err_deg'])
        out[row['solver']] = {'x': (row['X_rot_err_deg'], row['X_trans_err_mm']),
                              'y': (row['Y_rot_err_deg'], row['Y_trans_err_mm']) if both else None}
    return out


def share(hits):
    known = [hit for hit in hits if hit is not None]
    return f'{sum(known)} of {len(known)}' if known else ''


def row(name, of_sequences):
    x = np.array([of['x'] for of in of_sequences])
    y = [of['y'] for of in of_sequences if of['y'] is not None]
    middle, worst = np.median(x, axis=0), np.max(x, axis=0)
    other = '{:.3f} | {:.2f}'.format(*np.median(np.array(y), axis=0)) if y else ' | '
    covered = [share([of['inside'][i] for of in of_sequences]) if 'inside' in of_sequences[0] else '' for i in (0, 1)]
    return (f'| {name} | {middle[0]:.3f} | {middle[1]:.2f} | {worst[0]:.2f} | {worst[1]:.1f} | {other} | '
            f'{covered[0]} | {covered[1]} |')


def print_track(title, results):
    """Results by sequence and method."""
    answered = {name: of for name, of in results.items() if isinstance(of[POSES], dict)}
    print(f'\n### {title}: {len(answered)} of {len(results)} sequences answered by ours\n')
    if answered:
        print('| method | X ° | mm | worst X ° | mm | Y ° | mm | hand-eye in its 95 % region | other link |')
        print('|---|---|---|---|---|---|---|---|---|')
        methods = [*benchmark.SOLVERS, CORNERS, SCALED, POSES]
        order = {}
        for method in methods:
            found = [of[method] for of in answered.values() if isinstance(of.get(method), dict)]
            if found:
                name = method if len(found) == len(answered) else f'{method} ({len(found)} sequences)'
                order[method] = row(name, found)
        for line in order.values():
            print(line)
    for sequence, of in results.items():
        for method in (POSES, SCALED, CORNERS):
            if isinstance(of.get(method), str):
                shipped = [(of[name]['x'][1], name) for name in benchmark.SOLVERS if isinstance(of[name], dict)]
                least, best = min(shipped)
                middle = np.median([error for error, _ in shipped])
                print(f'\n{sequence}, {method}: {of[method][:260]}\n(of the shipped methods the best here, {best}, is off by '
                      f'{least:.1f} mm, the median by {middle:.1f} mm)')
    sys.stdout.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--data', required=True, help='folder of the tier; generated when it is not there')
    parser.add_argument('--tier', default='smoke', help='smoke, small, medium, full')
    parser.add_argument('--tracks', nargs='*', help='all when left out')
    parser.add_argument('--each', action='store_true', help='a line for every sequence too')
    arguments = parser.parse_args()
    generate(arguments.tier, arguments.data)
    manifest = load_manifest(arguments.data)
    tracks = arguments.tracks or list(dict.fromkeys(manifest.track))
    for track in tracks:
        by_sync = {}
        for name in manifest[manifest.track == track].sequence_id:
            sequence = load_sequence(arguments.data, name, manifest)
            modes = ['oracle'] if sequence.synchronous else ['oracle', 'estimated', 'by ours']
            for mode in modes:
                offset = None if sequence.synchronous else sequence.time_offset
                if mode == 'estimated':
                    offset, _ = benchmark.solvers.estimate_time_offset(
                        sequence.robot.t, sequence.robot.T_base_ee_meas, sequence.camera.t, sequence.camera.T_cam_target_meas)
                if mode == 'by ours':
                    clocks = offset_of(sequence)
                    offset = -clocks.offset_s
                if mode != 'oracle':
                    said = f' ± {1e3 * clocks.sigma_s:.3f}' if mode == 'by ours' else ''
                    print(f'{name}, offset {mode}: off by {1e3 * (offset - sequence.time_offset):+.3f}{said} ms')
                # The others know no offset but their own estimate.
                theirs = theirs_on(sequence, 'oracle' if mode == 'oracle' else 'estimated')
                found = {**theirs, **ours_on(sequence, offset)}
                key = mode if not sequence.synchronous else ''
                by_sync.setdefault(key, {})[name] = found
                if arguments.each:
                    for method, of in found.items():
                        print(name, mode, method, json.dumps(of))
        for mode, results in by_sync.items():
            print_track(track + (f', clock offset {mode}' if mode else ''), results)


if __name__ == '__main__':
    main()
