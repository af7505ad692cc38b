"""The Python module against OpenCV 4, the command line and simulated truth.

    python handeye_module.py HANDEYE SCHEMA FOLDER

HANDEYE is the binary, FOLDER an empty one. Prints a line for every check.
"""

import functools
import inspect
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import warnings

import cv2
import numpy as np

import handeye
import simulated
from simulated import BASE_FROM_TARGET, MATRIX, POINTS, SIZE, TIP_FROM_CAMERA, inverse, pose, session, write_folder

BOARD = handeye.Target.chessboard(simulated.COLUMNS, simulated.ROWS, simulated.SQUARE_M)
LENS = handeye.Intrinsics.from_opencv(MATRIX, None, SIZE)
CHECKS = []


def check(function):
    CHECKS.append(function)
    return function


def near(a, b, tolerance):
    assert np.abs(np.asarray(a) - np.asarray(b)).max() <= tolerance, f"{a}\nis not\n{b}"


def raises(kind, words, call, *arguments, **named):
    """The exception, whose message has all the words."""
    try:
        call(*arguments, **named)
    except kind as error:
        missing = [word for word in words if word not in str(error)]
        assert not missing, f"{missing} not in: {error}"
        return error
    raise AssertionError(f"no {kind.__name__} about {words}")


def in_opencv_order(s, camera_from_target=None):
    seen = s.camera_from_target if camera_from_target is None else camera_from_target
    split = lambda poses: ([p[:3, :3] for p in poses], [p[:3, 3:] for p in poses])
    return *split(s.base_from_tip), *split(seen)


def noisy_pairs(rng, views, robot_mm=0.3, robot_deg=0.05):
    """A session with the poses that OpenCV finds from its corners."""
    s = session(rng, views, 0.2, robot_mm, robot_deg)
    seen = []
    for corners in s.corners:
        _, turn, shift = cv2.solvePnP(POINTS, corners, MATRIX, None)
        seen.append(pose(turn[:, 0], shift[:, 0]))
    return s, np.array(seen)


@check
def exact_pairs_give_the_truth_and_what_opencv_gives(rng):
    s = session(rng, 12)
    pairs = in_opencv_order(s)
    for method in ("pose_pairs", "tsai", "park", "horaud", "andreff", "daniilidis", "shah", "li"):
        turn, shift = handeye.calibrate_hand_eye(*pairs, method=method)
        assert turn.shape == (3, 3) and shift.shape == (3, 1)
        near(np.hstack([turn, shift]), TIP_FROM_CAMERA[:3], 1e-9)
    for constant in range(5):
        near(np.hstack(handeye.calibrate_hand_eye(*pairs, method=constant)),
             np.hstack(cv2.calibrateHandEye(*pairs, method=constant)), 1e-9)


@check
def noisy_pairs_give_the_numbers_of_opencv(rng):
    # The same formulas: what is left is arithmetic, and OpenCV's Rodrigues, which takes turns below 1e-5 rad for none.
    for views in (5, 12, 30):
        s, seen = noisy_pairs(rng, views)
        pairs = in_opencv_order(s, seen)
        for constant in range(5):
            theirs = np.hstack(cv2.calibrateHandEye(*pairs, method=constant))
            near(np.hstack(handeye.calibrate_hand_eye(*pairs, method=constant)), theirs, 1e-9)
            # By position too, where OpenCV has an output.
            near(np.hstack(handeye.calibrate_hand_eye(*pairs, constant)), theirs, 1e-9)
        world = [inverse(p) for p in s.base_from_tip]
        pairs = [p[:3, :3] for p in seen], [p[:3, 3:] for p in seen], [p[:3, :3] for p in world], [p[:3, 3:] for p in world]
        for constant in range(2):
            theirs = cv2.calibrateRobotWorldHandEye(*pairs, method=constant)
            ours = handeye.calibrate_robot_world_hand_eye(*pairs, method=constant)
            for mine, other in zip(ours, theirs):
                assert mine.shape == other.shape
                near(mine, other, 1e-9)


@check
def rotation_vectors_and_flat_translations_are_taken_as_opencv_takes_them(rng):
    s = session(rng, 8)
    turns, shifts, seen, distances = in_opencv_order(s)
    vectors = [cv2.Rodrigues(r)[0] for r in turns]
    flat = handeye.calibrate_hand_eye(vectors, [t[:, 0] for t in shifts], seen, np.array(distances).reshape(-1, 3))
    near(np.hstack(flat), TIP_FROM_CAMERA[:3], 1e-9)


@check
def a_standing_camera_is_found_by_either_function(rng):
    s = session(rng, 15, 0.1, 0.1, 0.02)
    # The same chain with the roles of base and tip exchanged.
    reported = np.array([inverse(p) for p in s.base_from_tip])
    result = handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=reported, intrinsics=LENS, mode="eye_to_hand")
    assert result.tip_from_camera is None and result.base_from_target is None
    assert simulated.error(result.base_from_camera)[0] < 1.0
    near(result.tip_from_target[:3, 3], BASE_FROM_TARGET[:3, 3], 1e-3)
    assert result.hand_eye is result.base_from_camera


@check
def corners_give_the_answer_with_its_uncertainty(rng):
    s = session(rng, 15, 0.1, 0.1, 0.02)
    told = []
    result = handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, image_size=SIZE,
                               mode="eye_in_hand", progress=lambda stage, part: told.append((stage, part)))
    millimetres, degrees = simulated.error(result.tip_from_camera)
    # Three times the RMS error that it states for itself: by chance once in a million.
    variances = np.diag(result.hand_eye_covariance)
    stated_mm, stated_degrees = 1e3 * np.sqrt(variances[:3].sum()), np.degrees(np.sqrt(variances[3:].sum()))
    assert millimetres < 3 * stated_mm and degrees < 3 * stated_degrees, (millimetres, degrees, stated_mm, stated_degrees)
    # Where the board was seen the answer is off by less than it says; with the lens known it says less.
    point = np.array([*result.document["estimate"]["reference_point_m"], 1.0])
    off_mm = 1e3 * np.linalg.norm((result.tip_from_camera - TIP_FROM_CAMERA) @ point)
    assert off_mm < result.tip_error_95_mm, (off_mm, result.tip_error_95_mm)
    known = handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, intrinsics=LENS,
                              mode="eye_in_hand")
    assert 0 < known.tip_error_95_mm < result.tip_error_95_mm
    # A lens that is known to half a pixel counts with that, and follows the views.
    near_lens = handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, intrinsics=LENS,
                                  intrinsics_accuracy_px=0.5, mode="eye_in_hand")
    assert known.tip_error_95_mm < near_lens.tip_error_95_mm < result.tip_error_95_mm
    assert not near_lens.intrinsics_are_known and max(near_lens.intrinsics.sigma[2:]) < 0.5
    raises(handeye.InputError, "intrinsics_accuracy_px", handeye.calibrate, corners=s.corners, target=BOARD,
           base_from_tip=s.base_from_tip, intrinsics=LENS, intrinsics_accuracy_px=0.0, mode="eye_in_hand")
    # How near a tool arrives is known where the accuracy of the robot is.
    assert result.reach_error_95_mm is None and result.robot_accuracy_mm is None
    accurate = handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, image_size=SIZE,
                                 mode="eye_in_hand", robot_accuracy_mm=0.5)
    assert accurate.robot_accuracy_mm == 0.5 and accurate.tip_error_95_mm == result.tip_error_95_mm
    assert 1.0 < accurate.reach_error_95_mm < 6.0, accurate.reach_error_95_mm
    for wrong in (0.0, 500.0, float("nan")):
        raises(handeye.InputError, "robot_accuracy_mm", handeye.calibrate, corners=s.corners, target=BOARD,
               base_from_tip=s.base_from_tip, image_size=SIZE, mode="eye_in_hand", robot_accuracy_mm=wrong)
    for covariance in (result.hand_eye_covariance, result.target_covariance):
        assert covariance.shape == (6, 6)
        near(covariance, covariance.T, 1e-15)
        assert np.linalg.eigvalsh(covariance).min() > 0
    near(result.intrinsics.camera_matrix[:2], MATRIX[:2], 5.0)
    assert not result.intrinsics_are_known and min(result.intrinsics.sigma) > 0
    assert 0.05 < result.corner_sigma_px < 0.2 and result.robot_sigma_mm > 0 and result.robot_sigma_deg > 0
    assert [view.status for view in result.views] == ["used"] * 15
    assert all(0 < view.rms_px < 1 for view in result.views)
    assert {stage for stage, _ in told} >= {"calibrating the camera", "estimating jointly"}
    assert all(0 <= part <= 1 for _, part in told)
    assert set(result.methods) >= {"tsai_lenz", "park_martin", "shah"}
    # The points of calibrateCamera say the same as the kind of target.
    same = handeye.calibrate(corners=[c[:, None] for c in s.corners], target=POINTS, base_from_tip=s.base_from_tip,
                             image_size=SIZE, mode="eye_in_hand")
    near(same.tip_from_camera, result.tip_from_camera, 0)


@check
def a_board_seen_in_part_says_which_corners_it_shows(rng):
    s = session(rng, 12, 0.05, 0.05, 0.01)
    ids = [np.sort(rng.choice(70, 40, replace=False)) for _ in s.corners]
    corners = [c[i] for c, i in zip(s.corners, ids)]
    corners[3] = None
    result = handeye.calibrate(corners=corners, corner_ids=ids, target=BOARD, base_from_tip=s.base_from_tip,
                               intrinsics=LENS, mode="eye_in_hand")
    assert simulated.error(result.tip_from_camera)[0] < 1.0
    assert result.views[3].status == "no_target" and result.intrinsics_are_known


@check
def pairs_state_their_disagreement_and_leave_outliers_out(rng):
    s, seen = noisy_pairs(rng, 14)
    seen[5] = seen[5] @ pose([0.2, 0.1, 0.0], [0.03, 0.0, 0.0])
    names = [f"photo {i}" for i in range(14)]
    result = handeye.calibrate(base_from_tip=s.base_from_tip, camera_from_target=seen, mode="eye_in_hand", names=names)
    assert [view.name for view in result.views if view.status == "outlier"] == ["photo 5"]
    assert any(f.code == "outlier_view" and f.views == ("photo 5",) for f in result.findings), result.findings
    assert 0.05 < result.pair_sigma_mm < 5 and 0.01 < result.pair_sigma_deg < 1 and result.tip_error_95_mm is None
    assert np.linalg.eigvalsh(result.hand_eye_covariance).min() > 0 and result.intrinsics is None
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        handeye.calibrate_hand_eye(*in_opencv_order(s, seen))
    assert [w.category for w in said] == [handeye.CalibrationWarning] and "view 5" in str(said[0].message)
    assert said[0].filename == __file__


@check
def the_doctor_accuses_an_injected_fault(rng):
    s = session(rng, 12, 0.1, 0.1, 0.02)
    good = dict(corners=s.corners, target=BOARD, intrinsics=LENS, mode="eye_in_hand")
    healthy = handeye.doctor(base_from_tip=s.base_from_tip, **good)
    assert healthy.is_healthy and healthy.untested is None, healthy.report
    inverted = np.array([inverse(p) for p in s.base_from_tip])
    millimetres = s.base_from_tip.copy()
    millimetres[:, :3, 3] *= 1e3
    for poses, code in ((inverted, "inverted_poses"), (millimetres, "wrong_length_unit"),
                        (np.roll(s.base_from_tip, 1, axis=0), "shifted_poses")):
        diagnosis = handeye.doctor(base_from_tip=poses, **good)
        assert code in [f.code for f in diagnosis.findings], diagnosis.report
        assert not diagnosis.is_healthy and any(h.accepted and h.code == code for h in diagnosis.hypotheses)
        assert diagnosis.report.strip() and json.loads(diagnosis.to_json())["findings"]
        # And the calibration is not to be used.
        try:
            result = handeye.calibrate(base_from_tip=poses, **good)
        except handeye.CalibrationError:
            continue
        assert result.problem is not None and result.tip_error_95_mm is None, code


@check
def bad_input_is_an_exception_that_says_what_to_do(rng):
    s = session(rng, 8, 0.1, 0.1, 0.02)
    good = dict(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, image_size=SIZE, mode="eye_in_hand")
    bad = lambda words, **change: raises(handeye.InputError, words, handeye.calibrate, **{**good, **change})
    spoilt = s.base_from_tip.copy()
    spoilt[2, 0, 3] = np.nan
    bad(["base_from_tip", "view 2", "not finite", "leave this view out"], base_from_tip=spoilt)
    spoilt = s.base_from_tip.copy()
    spoilt[4, :3, :3] = spoilt[4, :3, :3] * [1, 1, -1]
    bad(["view 4", "mirrors"], base_from_tip=spoilt)
    spoilt = s.base_from_tip.copy()
    spoilt[1, :3, :3] *= 1.1
    bad(["view 1", "orthonormal"], base_from_tip=spoilt)
    bad(["last row", "transposed"], base_from_tip=np.swapaxes(s.base_from_tip, 1, 2))
    bad(["shape (8, 3, 4)", "(N, 4, 4)"], base_from_tip=s.base_from_tip[:, :3])
    bad(["shape (4,)", "4 × 4"], base_from_tip=[p[0] for p in s.base_from_tip])
    bad(["not an array of numbers"], base_from_tip="poses.csv")
    bad(["8 in corners", "7 in base_from_tip"], base_from_tip=s.base_from_tip[:7])
    corners = list(s.corners)
    corners[6] = corners[6][:50]
    bad(["view 6", "50", "70 points", "corner_ids"], corners=corners)
    bad(["corners[0] has shape (70, 3)"], corners=[np.zeros((70, 3))] * 8)
    corners[6] = s.corners[6].copy()
    corners[6][9, 1] = np.inf
    bad(["view 6", "corner 9", "not finite"], corners=corners)
    corners[6][9, 1] = 481.0
    bad(["view 6", "corner 9", "outside of the image"], corners=corners)
    ids = [np.arange(70)] * 8
    bad(["view 0", "corner 70 is not on the target"], corner_ids=[np.arange(1, 71), *ids[1:]])
    bad(["view 0", "twice"], corner_ids=[np.zeros(70, dtype=int), *ids[1:]])
    bad(["mode is missing", "eye_to_hand"], mode=None)
    bad(["'eye-in-hand'", "'eye_in_hand'"], mode="eye-in-hand")
    bad(["image_size is missing"], image_size=None)
    bad(["target is missing"], target=None)
    bad(["base_from_tip is missing"], base_from_tip=None)
    bad(["keep corners"], camera_from_target=s.camera_from_target)
    bad(["same name"], names=["a"] * 8)
    bad(['no method "tsai"', "tsai_lenz"], method="tsai")
    bad(["grid"], target=rng.normal(size=(70, 3)))
    raises(handeye.InputError, ["give corners, or camera_from_target"], handeye.calibrate, base_from_tip=s.base_from_tip,
           mode="eye_in_hand")
    raises(handeye.InputError, ["square_m", "positive"], handeye.Target.chessboard, 10, 7, 0.0)
    raises(handeye.InputError, ["columns"], handeye.Target.chessboard, 2, 7, 0.01)
    raises(handeye.InputError, ["6 dist_coeffs"], handeye.Intrinsics.from_opencv, MATRIX, np.zeros(6), SIZE)
    assert issubclass(handeye.InputError, ValueError) and issubclass(handeye.CalibrationError, RuntimeError)

    pairs = in_opencv_order(s)
    opencv = lambda words, *arguments, **named: raises(
        handeye.InputError, words, handeye.calibrate_hand_eye, *arguments, **named)
    opencv(["no method 7", "0 tsai_lenz"], *pairs, method=7)
    opencv(["no method 'best'", "'pose_pairs'"], *pairs, "best")
    opencv(["no method None"], *pairs, None)
    opencv(["8 poses", "7 of the target"], *pairs[:2], pairs[2][:7], pairs[3][:7])
    opencv(["t_target2cam[0] has shape (2,)"], *pairs[:3], [np.zeros(2)] * 8)
    opencv(["R_gripper2base has 8 views and t_gripper2base 7"], pairs[0], pairs[1][:7], *pairs[2:])


@check
def data_without_an_answer_say_what_to_capture(rng):
    s = session(rng, 12, 0.1, 0.1, 0.02)
    few = dict(base_from_tip=s.base_from_tip[:2], camera_from_target=s.camera_from_target[:2], mode="eye_in_hand")
    raises(handeye.CalibrationError, ["in sight: 2", "at least 3", "capture more poses"], handeye.calibrate, **few)
    one_axis = np.array([pose([0, 0, 0.3 * i], [0.02 * i, 0.01, 0.5]) for i in range(8)])
    s = session(rng, 8, 0.1, camera_from_target=one_axis)
    for method in ("pose_pairs", "park", "shah"):
        raises(handeye.CalibrationError, ["about the same axis", "add views turned"], handeye.calibrate_hand_eye,
               *in_opencv_order(s), method=method)
    raises(handeye.CalibrationError, ["about the same axis", "30°"], handeye.calibrate, corners=s.corners, target=BOARD,
           base_from_tip=s.base_from_tip, intrinsics=LENS, mode="eye_in_hand")
    still = session(rng, 8, 0.1, camera_from_target=np.array([pose([0.1, 0, 0], [0.01 * i, 0, 0.5]) for i in range(8)]))
    raises(handeye.CalibrationError, ["turn the tip by 30°"], handeye.calibrate_hand_eye, *in_opencv_order(still))
    diagnosis = handeye.doctor(base_from_tip=still.base_from_tip, camera_from_target=still.camera_from_target,
                               mode="eye_in_hand")
    assert diagnosis.untested and not diagnosis.is_healthy


@check
def a_folder_reads_to_the_numbers_in_it_and_solves_as_on_the_command_line(rng):
    binary, folder = sys.argv[1], sys.argv[3]
    s = session(rng, 12, 0.1, 0.1, 0.02)
    for kind in ("corners", "pairs"):
        path = os.path.join(folder, kind)
        write_folder(path, s, corners=kind == "corners")
        data = handeye.load_dataset(path)
        # A rotation goes through a quaternion.
        near(data.base_from_tip, s.base_from_tip, 1e-14)
        assert data.mode == "eye_in_hand" and data.target == BOARD and len(data.names) == 12
        if kind == "corners":
            near(data.corners, s.corners, 0)
            near(data.corner_ids, [np.arange(70)] * 12, 0)
            assert data.image_size == SIZE and data.camera_from_target is None
        else:
            near(data.camera_from_target, s.camera_from_target, 1e-14)
            assert data.corners is None and data.image_paths == [None] * 12
        # 0.3 mm is the goal of the command line.
        result = handeye.calibrate(data, goal_mm=0.3)
        output = os.path.join(folder, kind + ".json")
        subprocess.run([binary, "calibrate", path, "--quiet", "--json", output], check=True, stdout=subprocess.DEVNULL)
        with open(output) as file:
            assert json.load(file) == json.loads(result.to_json())
        diagnosis = subprocess.run([binary, "doctor", path, "--quiet", "--json", "-"], check=True, stdout=subprocess.PIPE)
        assert json.loads(diagnosis.stdout) == json.loads(handeye.doctor(data).to_json())
        # The arrays of a data set give its answer, and with something changed another.
        if kind == "corners":
            arrays = dict(corners=data.corners, corner_ids=data.corner_ids, target=data.target, mode=data.mode,
                          base_from_tip=data.base_from_tip, image_size=data.image_size, names=data.names)
        else:
            arrays = dict(camera_from_target=data.camera_from_target, target=data.target, mode=data.mode,
                          base_from_tip=data.base_from_tip, names=data.names)
        near(handeye.calibrate(**arrays).tip_from_camera, result.tip_from_camera, 1e-12)
        raises(handeye.InputError, ["a data set and mode"], handeye.calibrate, data, mode="eye_in_hand")
    path = os.path.join(folder, "images")
    write_folder(path, s, corners=False, images=True)
    data = handeye.load_dataset(path)
    assert data.image_size == (64, 48) and all(os.path.exists(p) for p in data.image_paths)
    for call in (handeye.calibrate, handeye.doctor):
        raises(handeye.InputError, ["12 images", "OpenCV", "handeye calibrate"], call, data)
    missing = os.path.join(folder, "nowhere")
    raises(handeye.InputError, [missing], handeye.load_dataset, missing)
    with open(os.path.join(path, "poses.csv"), "a") as file:
        file.write("images/099.png,1\n")
    raises(handeye.InputError, ["poses.csv", "14"], handeye.load_dataset, path)


@check
def a_folder_of_images_is_calibrated_by_the_program_and_one_of_corners_without_it(rng):
    binary, folder = sys.argv[1], sys.argv[3]
    by_program = lambda path: json.loads(subprocess.run(
        [binary, "calibrate", path, "--quiet", "--json", "-"], check=True, stdout=subprocess.PIPE).stdout)
    images, corners = (os.path.join(folder, name) for name in ("sample", "of_corners"))
    subprocess.run([binary, "sample", "--out", images, "--quiet"], check=True)
    write_folder(corners, session(rng, 8, 0.1, 0.1, 0.02))
    path = os.environ["PATH"]
    os.environ["PATH"] = os.path.dirname(binary)
    try:
        before = sorted(os.listdir(images))
        assert handeye.calibrate_dataset(images).document == by_program(images)
        assert sorted(os.listdir(images)) == before
        raises(handeye.InputError, ["nowhere"], handeye.calibrate_dataset, os.path.join(folder, "nowhere"))
        os.environ["PATH"] = ""
        raises(handeye.InputError, ["table of corners"], handeye.calibrate_dataset, images)
        os.environ["PATH"] = os.path.dirname(binary)
        # What the program says of images that it cannot read is said here.
        for name in os.listdir(os.path.join(images, "images")):
            cv2.imwrite(os.path.join(images, "images", name), np.zeros((480, 640), np.uint8))
        raises(handeye.CalibrationError, ["0 of 12 images"], handeye.calibrate_dataset, images)
        os.environ["PATH"] = ""
        assert handeye.calibrate_dataset(corners).document == by_program(corners)
    finally:
        os.environ["PATH"] = path


@check
def the_document_is_what_the_schema_says(rng):
    import jsonschema

    with open(sys.argv[2]) as file:
        schema = json.load(file)
    s = session(rng, 10, 0.1, 0.1, 0.02)
    results = [
        handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, image_size=SIZE,
                          mode="eye_in_hand", goal_mm=0.3),
        handeye.calibrate(base_from_tip=s.base_from_tip, camera_from_target=s.camera_from_target, mode="eye_in_hand"),
        handeye.calibrate(corners=s.corners, target=BOARD, image_size=SIZE),
        handeye.calibrate(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, intrinsics=LENS,
                          mode="eye_in_hand", method="daniilidis"),
    ]
    for result in results:
        jsonschema.validate(json.loads(result.to_json()), schema)
        assert result.document == json.loads(result.to_json())
    camera = results[2]
    assert camera.mode is None and camera.hand_eye is None and camera.intrinsics.fx > 0
    assert results[1].document["provenance"]["options"]["target"] is None


@check
def other_threads_run_while_it_computes_and_ctrl_c_ends_it(rng):
    s = session(rng, 60, 0.1, 0.1, 0.02)
    arguments = dict(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, image_size=SIZE, mode="eye_in_hand")
    began = time.monotonic()
    handeye.calibrate(**arguments)
    whole = time.monotonic() - began
    turns, running = [0], threading.Event()

    def count():
        while not running.is_set():
            turns[0] += 1

    thread = threading.Thread(target=count)
    thread.start()
    before = turns[0]
    handeye.calibrate(**arguments)
    counted = turns[0] - before
    running.set()
    thread.join()
    assert counted > 1000, counted

    # As Ctrl-C: Python's own handlers run in the middle of the work.
    signal.signal(signal.SIGALRM, signal.default_int_handler)
    signal.setitimer(signal.ITIMER_REAL, whole / 5)
    began = time.monotonic()
    raises(KeyboardInterrupt, [], handeye.calibrate, **arguments)
    assert time.monotonic() - began < whole, "the work went on"

    def stop(stage, part):
        raise ZeroDivisionError("enough")

    raises(ZeroDivisionError, ["enough"], handeye.calibrate, progress=stop, **arguments)


@check
def everything_public_is_documented_and_opencv_is_not_inside(rng):
    for name in handeye.__all__:
        value = getattr(handeye, name)
        if inspect.isclass(value) or inspect.isfunction(value):
            assert inspect.getdoc(value), name
    folder = os.path.dirname(handeye.__file__)
    assert os.path.exists(os.path.join(folder, "py.typed")) and os.path.exists(os.path.join(folder, "_handeye.pyi"))
    library, = [name for name in os.listdir(folder) if name.startswith("_handeye") and name.endswith((".so", ".pyd"))]
    assert ".abi3." in library, library
    with open(os.path.join(folder, library), "rb") as file:
        assert b"libopencv" not in file.read()
    assert re.fullmatch(r"\d+\.\d+\.\d+", handeye.__version__)


def swaying(times):
    """An arm that moves without repeating itself."""
    wave = lambda k: np.sin(2 * np.pi * (0.11 + 0.047 * k) * times + 1.7 * k) + np.sin(2 * np.pi * (0.4 + 0.05 * k) * times)
    turns = np.stack([0.5 * wave(k) for k in range(3)], axis=-1)
    shifts = np.stack([0.4 + 0.1 * wave(k + 3) for k in range(3)], axis=-1)
    return np.array([pose(turn, shift) for turn, shift in zip(turns, shifts)])


@check
def the_offset_of_two_clocks_is_told_and_robot_poses_are_there_at_the_times_of_images(rng):
    robot_stamps, camera_stamps = np.arange(0, 10, 0.008), np.arange(0.2, 9.8, 1 / 30)
    robot, there = swaying(robot_stamps), swaying(camera_stamps)
    for mode in ("eye_in_hand", "eye_to_hand"):
        mount, link = (there, TIP_FROM_CAMERA) if mode == "eye_in_hand" else (np.linalg.inv(there), BASE_FROM_TARGET)
        other = BASE_FROM_TARGET if mode == "eye_in_hand" else TIP_FROM_CAMERA
        jitter = [pose(rng.normal(0, 1e-3, 3), rng.normal(0, 5e-4, 3)) for _ in there]
        seen = np.array([inverse(link) @ inverse(m) @ other @ j for m, j in zip(mount, jitter)])
        found = handeye.clock_offset(robot_stamps, robot, camera_stamps - 0.08, seen, mode=mode)
        assert abs(found.offset_s - 0.08) < 5 * found.sigma_s < 5e-3, f"{mode}: {found}"
    poses, within = handeye.poses_at(camera_stamps, robot_stamps, robot)
    assert within.all()
    near(poses, there, 1e-3)
    assert not handeye.poses_at([11.0], robot_stamps, robot)[1].any()
    raises(handeye.InputError, ["robot", "rise", "entry 1"], handeye.clock_offset, np.zeros(len(robot)), robot, camera_stamps,
           seen, mode=mode)
    still = np.repeat(robot[:1], len(robot), axis=0)
    raises(handeye.CalibrationError, [], handeye.clock_offset, robot_stamps, still, camera_stamps,
           np.repeat(seen[:1], len(seen), axis=0), mode=mode)


@functools.lru_cache(maxsize=None)
def arm_case():
    """A session of a UR5e that is not quite one, its joint values, another of the same arm, and the calibration."""
    rng = np.random.default_rng(99)
    rows = simulated.real_arm(rng)
    s, joints = simulated.arm_session(rng, 25, rows)
    result = handeye.calibrate(**of_arm(s), joints=joints, arm="ur5e")
    return s, joints, simulated.arm_session(rng, 10, rows), result


def of_arm(s):
    return dict(corners=s.corners, target=BOARD, base_from_tip=s.base_from_tip, intrinsics=LENS, mode="eye_in_hand")


def urdf_of_rows(rows):
    """The arm as a URDF: what follows a joint is the origin of the next one."""
    links = "".join(f'<link name="l{i}"/>' for i in range(len(rows) + 1)) + '<link name="flange"/>'
    numbers = lambda values: " ".join(repr(float(v)) for v in values)
    text, behind = "", (0.0, 0.0, 0.0)
    for i, (a, alpha, d, theta) in enumerate(rows):
        assert theta == 0.0
        text += (f'<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{i + 1}"/><axis xyz="0 0 1"/>'
                 f'<origin xyz="{numbers((behind[0], 0, behind[1]))}" rpy="{numbers((behind[2], 0, 0))}"/></joint>')
        behind = (a, d, alpha)
    text += (f'<joint name="end" type="fixed"><parent link="l{len(rows)}"/><child link="flange"/>'
             f'<origin xyz="{numbers((behind[0], 0, behind[1]))}" rpy="{numbers((behind[2], 0, 0))}"/></joint>')
    return f'<robot name="r">{links}{text}</robot>'


@check
def the_errors_of_the_arm_are_found_and_its_commands_arrive(rng):
    s, joints, (fresh, there), result = arm_case()
    arm = result.arm
    assert len(arm.joints) == 6 and not arm.contradicted and arm.heldout_px[1] < arm.heldout_px[0]
    first, last = arm.joints[0], arm.joints[5]
    assert first.tilt_deg is None and last.zero_deg is None and last.tilt_deg is not None and last.tilt_sigma_deg[0] > 0
    assert 0.02 < arm.levels.angle_deg < 0.5 and 0.05 < arm.levels.length_mm < 1.5
    assert arm.reach_error_corrected_95_mm < 0.5 * arm.reach_error_95_mm
    assert arm.hand_eye_covariance.shape == arm.target_covariance.shape == (6, 6)
    # The lens that goes with the hand-eye of the arm; a lens that was given is one and the same.
    assert arm.intrinsics is not None and (arm.intrinsics.fx == result.intrinsics.fx) == (arm.intrinsics.sigma is None)
    # Where the board is seen in views that the calibration does not have, by corrected poses and by reported ones.
    middle = np.array([*POINTS.mean(axis=0), 1.0])

    def off_mm(base_from_tip, hand_eye, target):
        predicted = [inverse(hand_eye) @ inverse(p) @ target @ middle for p in base_from_tip]
        squares = [np.sum((p - look @ middle)[:3] ** 2) for p, look in zip(predicted, fresh.camera_from_target)]
        return 1e3 * np.sqrt(np.mean(squares))

    actual = result.actual(there)
    corrected = off_mm(actual.base_from_tip, arm.hand_eye, arm.target)
    reported = off_mm(fresh.base_from_tip, result.tip_from_camera, result.base_from_target)
    assert corrected < 0.3 * reported, (corrected, reported)
    # The command is by the controller's own kinematics, and takes the tip where it is wanted.
    wanted = fresh.base_from_tip
    command = result.correct(wanted, near=there)
    assert command.joints.shape == (10, 6) and command.base_from_tip.shape == (10, 4, 4) and command.error_95_mm.shape == (10,)
    near(command.base_from_tip, [simulated.forward(simulated.UR5E, q) for q in command.joints], 1e-5)
    near(result.actual(command.joints).base_from_tip, wanted, 1e-8)
    assert np.abs(command.base_from_tip[:, :3, 3] - wanted[:, :3, 3]).max() > 1e-4
    one = result.correct(wanted[4], near=there[4])
    near(one.joints, command.joints[4], 1e-12)
    assert one.joints.shape == (6,) and one.base_from_tip.shape == (4, 4) and one.error_95_mm == command.error_95_mm[4]
    where = result.actual(there[4])
    near(where.base_from_tip, actual.base_from_tip[4], 0)
    assert where.error_95_mm == actual.error_95_mm[4] > 0
    # Each without a place to be near is near the one before.
    chain = result.correct(wanted, near=there[0])
    near(chain.joints[0], command.joints[0], 1e-12)
    near(result.actual(chain.joints).base_from_tip, wanted, 1e-8)
    assert result.correct(wanted[0]).joints.shape == (6,)


@check
def the_arm_is_named_by_its_rows_or_its_file_as_well(rng):
    s, joints, _, result = arm_case()
    path = os.path.join(sys.argv[3], "arm.urdf")
    with open(path, "w") as file:
        file.write(urdf_of_rows(simulated.UR5E))
    for arm in (simulated.UR5E, simulated.UR5E.tolist(), path, (path, "l0", "l6")):
        other = handeye.calibrate(**of_arm(s), joints=list(joints), arm=arm)
        # The numbers of the chain differ by rounding, and each search for noise levels ends within a thousandth of them.
        near(other.arm.hand_eye, result.arm.hand_eye, 1e-8)
        near(other.tip_from_camera, result.tip_from_camera, 1e-9)
    assert handeye.doctor(**of_arm(s), joints=joints, arm="ur5e").findings is not None
    # Without its joints the arm is not known.
    plain = handeye.calibrate(**of_arm(s))
    assert plain.arm is None


@check
def a_result_is_read_again_and_corrects_as_before(rng):
    import jsonschema

    s, joints, (_, there), result = arm_case()
    with open(sys.argv[2]) as file:
        jsonschema.validate(result.document, json.load(file))
    folder = os.path.join(sys.argv[3], "kept")
    os.makedirs(folder)
    path = os.path.join(folder, "result.json")
    with open(path, "w") as file:
        file.write(result.to_json())
    for place in (path, folder):
        again = handeye.load_calibration(place)
        assert again.document == result.document and again.to_json() == result.to_json()
        near(again.actual(there).base_from_tip, result.actual(there).base_from_tip, 0)
        assert again.arm.reach_error_95_mm == result.arm.reach_error_95_mm
    raises(handeye.InputError, ["nowhere.json"], handeye.load_calibration, os.path.join(folder, "nowhere.json"))
    with open(os.path.join(folder, "other.json"), "w") as file:
        file.write("{}")
    raises(handeye.InputError, ["other.json", "not a calibration result"], handeye.load_calibration,
           os.path.join(folder, "other.json"))
    document = json.loads(result.to_json())
    document["arm"]["contradicted"] = True
    with open(path, "w") as file:
        json.dump(document, file)
    doubted = handeye.load_calibration(path)
    for call in (lambda: doubted.actual(there), lambda: doubted.correct(s.base_from_tip[0], near=joints[0])):
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            call()
        assert [w.category for w in said] == [handeye.CalibrationWarning] and "do not correct" in str(said[0].message)
        assert said[0].filename == __file__


@check
def what_is_wrong_about_an_arm_says_what_to_do(rng):
    s, joints, (fresh, there), result = arm_case()
    bad = lambda words, **change: raises(
        handeye.InputError, words, handeye.calibrate, **{**of_arm(s), "joints": joints, "arm": "ur5e", **change})
    bad(["joints without arm", "both or neither"], arm=None)
    bad(["arm without joints", "both or neither"], joints=None)
    bad(["24 in joints", "25 in base_from_tip"], joints=joints[:24])
    bad(["shape (6,)", "(N, n)"], joints=joints[0])
    bad(["7 values", "6 joints"], joints=np.hstack([joints, joints[:, :1]]))
    bad(['"ur6"', "ur5e", "URDF"], arm="ur6")
    bad(["shape (6, 3)", "(n, 4)"], arm=simulated.UR5E[:, :3])
    bad(["nowhere.urdf"], arm="nowhere.urdf")
    spoilt = joints.copy()
    spoilt[3, 2] = np.nan
    bad(["joints of view \"view 3\"", "not finite"], joints=spoilt)
    bad(["do not belong to the poses", "unit"], joints=np.degrees(joints))
    few = {key: value[:2] if key in ("corners", "base_from_tip") else value for key, value in of_arm(s).items()}
    raises(handeye.CalibrationError, ["at least 3"], handeye.calibrate, **few, joints=joints[:2], arm="ur5e")
    raises(handeye.InputError, ["base_from_tip is missing"], handeye.calibrate, corners=s.corners, target=BOARD,
           image_size=SIZE, joints=joints, arm="ur5e")
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        handeye.doctor(**of_arm(s), joints=np.degrees(joints), arm="ur5e")
    assert [w.category for w in said] == [handeye.CalibrationWarning] and "are not used" in str(said[0].message)
    assert said[0].filename == __file__
    # A controller that counts with its factory calibration: there is no chain to correct by.
    other = [simulated.forward(simulated.real_arm(np.random.default_rng(1)), q) for q in joints]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        result_of_other = handeye.calibrate(**{**of_arm(s), "base_from_tip": other}, joints=joints, arm="ur5e")
    assert result_of_other.arm is None and "factory calibration" in str(said[0].message) and said[0].filename == __file__
    for call in (lambda: result_of_other.correct(s.base_from_tip[0]), lambda: result_of_other.actual(joints)):
        raises(handeye.InputError, ["no errors of an arm", "joints= and arm="], call)
    raises(handeye.InputError, ["shape (3, 4)"], result.correct, s.base_from_tip[0][:3])
    raises(handeye.InputError, ["near has shape (5,)", "(6,)"], result.correct, s.base_from_tip[0], near=joints[0][:5])
    raises(handeye.InputError, ["joints have shape (25, 5)"], result.actual, joints[:, :5])
    raises(handeye.InputError, ["joints[3]", "not finite"], result.actual, spoilt)
    far = np.array(s.base_from_tip[:4])
    far[2, 0, 3] = 3.0
    raises(handeye.InputError, ["pose[2]", "closer"], result.correct, far, near=joints[0])
    raises(handeye.InputError, ["pose: "], result.correct, far[2], near=joints[0])
    far[2] = far[2] * [1, 1, -1, 1]
    raises(handeye.InputError, ["pose[2]", "mirrors"], result.correct, far, near=joints[0])


@check
def an_arm_in_a_folder_solves_and_corrects_as_on_the_command_line(rng):
    binary, path = sys.argv[1], os.path.join(sys.argv[3], "with_arm")
    s, joints, (fresh, there), _ = arm_case()
    write_folder(path, s, joints=joints)
    # 0.3 mm is the goal of the command line.
    result = handeye.calibrate(handeye.load_dataset(path), goal_mm=0.3)
    output = path + ".json"
    subprocess.run([binary, "calibrate", path, "--quiet", "--json", output], check=True, stdout=subprocess.DEVNULL)
    with open(output) as file:
        assert json.load(file) == json.loads(result.to_json())
    assert result.arm is not None and result.arm.reach_error_95_mm > result.arm.reach_error_corrected_95_mm > 0
    # The command line reads poses and joint values to be near from standard input.
    command = result.correct(fresh.base_from_tip, near=there)
    rows = ["x,y,z,qx,qy,qz,qw,q1,q2,q3,q4,q5,q6"]
    for p, q in zip(fresh.base_from_tip, there):
        rows.append(",".join(repr(float(v)) for v in [*p[:3, 3], *quaternion(p), *q]))
    run = lambda text, *options: json.loads(subprocess.run(
        [binary, "correct", output, "-", *options, "--json", "-"], check=True, input="\n".join(text), text=True,
        stdout=subprocess.PIPE).stdout)
    answers = run(rows)
    near([a["joints_rad"] for a in answers], command.joints, 1e-9)
    near([a["translation_m"] for a in answers], command.base_from_tip[:, :3, 3], 1e-9)
    near([a["error_95_mm"] for a in answers], command.error_95_mm, 1e-6)
    rows = ["q1,q2,q3,q4,q5,q6", *(",".join(repr(float(v)) for v in q) for q in there)]
    answers = run(rows, "--from-reported")
    near([a["translation_m"] for a in answers], result.actual(there).base_from_tip[:, :3, 3], 1e-9)


def quaternion(p):
    """x y z w, by the largest of them."""
    m = p[:3, :3]
    squares = np.array([1 + m[0, 0] - m[1, 1] - m[2, 2], 1 - m[0, 0] + m[1, 1] - m[2, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2],
                        1 + np.trace(m)])
    rows = np.array([
        [squares[0], m[0, 1] + m[1, 0], m[0, 2] + m[2, 0], m[2, 1] - m[1, 2]],
        [m[0, 1] + m[1, 0], squares[1], m[1, 2] + m[2, 1], m[0, 2] - m[2, 0]],
        [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], squares[2], m[1, 0] - m[0, 1]],
        [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], squares[3]],
    ])
    row = rows[np.argmax(squares)]
    return row / np.linalg.norm(row)


def main():
    for index, function in enumerate(CHECKS):
        function(np.random.default_rng(index))
        print(function.__name__)


if __name__ == "__main__":
    main()
