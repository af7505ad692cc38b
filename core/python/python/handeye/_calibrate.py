"""From observations to a calibration or a diagnosis."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any, Callable, Optional, Sequence, Tuple, Union

from . import _handeye, _program
from ._arm import described as described_arm
from ._arrays import corners_of_views, joints_of_views, packed, poses
from ._dataset import Dataset, load_dataset
from ._errors import CalibrationWarning, InputError
from ._result import Calibration, Diagnosis
from ._types import Intrinsics, Target

Progress = Callable[[str, float], None]
Modes = ("eye_in_hand", "eye_to_hand")
# The goal of `handeye calibrate`, millimetres.
GOAL_MM = 0.3


def calibrate(
    dataset: Optional[Dataset] = None,
    *,
    corners: Optional[Sequence[Any]] = None,
    corner_ids: Optional[Sequence[Any]] = None,
    target: Any = None,
    base_from_tip: Any = None,
    camera_from_target: Any = None,
    image_size: Optional[Tuple[int, int]] = None,
    intrinsics: Optional[Intrinsics] = None,
    intrinsics_accuracy_px: Optional[float] = None,
    intrinsics_start: Optional[Intrinsics] = None,
    lens_model: Optional[str] = None,
    mode: Optional[str] = None,
    names: Optional[Sequence[str]] = None,
    joints: Any = None,
    arm: Any = None,
    robot_accuracy_mm: Optional[float] = None,
    method: str = "joint",
    keep_outliers: bool = False,
    free_scale: bool = False,
    goal_mm: Optional[float] = None,
    progress: Optional[Progress] = None,
) -> Calibration:
    """Finds where the camera is on the robot, and how well that is known.

    From corners (`corners`, `target`, `base_from_tip`, `image_size`, `mode`): the joint estimate of hand-eye, target, lens
    and robot errors. From pose pairs (`base_from_tip`, `camera_from_target`, `mode`): the estimate from poses alone. From
    corners without `base_from_tip`: the camera alone. From a data set of `load_dataset`: what its folder says.

    Parameters
    ----------
    dataset
        A data set; everything up to `robot_accuracy_mm` is then left out.
    corners
        For each of N views (M, 2) pixels u, v, or None where the target was not found. (0, 0) is the centre of the top-left
        pixel, as OpenCV has it; (M, 1, 2), which OpenCV's detectors answer, is taken too.
    corner_ids
        For each view (M,) which points of the target these are; left out where every view has all of them in order.
    target
        A `Target`, or (M, 3) points of a grid as OpenCV's calibrateCamera takes them. With pose pairs it may be left out.
    base_from_tip
        (N, 4, 4) pose of the tip in the base for each view, as the controller reports it, metres. OpenCV calls it
        gripper2base.
    camera_from_target
        (N, 4, 4) pose of the target in the camera for each view, metres. OpenCV calls it target2cam.
    image_size
        (width, height) in pixels.
    intrinsics
        The camera, where it is known: taken as exact, or as well as `intrinsics_accuracy_px` says. Otherwise it is estimated.
    intrinsics_accuracy_px
        What each parameter of `intrinsics` may displace points of the image by, one standard deviation, RMS, pixels; half a pixel
        is usual of a data sheet or another program. They then follow the views as far as these know more, and the expected error counts it.
    intrinsics_start
        Where that estimate starts; found from the views when left out.
    lens_model
        Which lens is estimated: none, brown_conrady (when left out), rational or fisheye.
    mode
        eye_in_hand (the camera is on the tip, the target stands still) or eye_to_hand (the camera stands still, the target is
        on the tip). Needed with `base_from_tip`: it is never guessed.
    names
        Of the views, for messages; "view 0", "view 1" … when left out.
    joints
        (N, n) joint values of the arm for each view, as the controller reports them, radians. With `arm` the errors of the arm
        are estimated too: `Calibration.arm`, `Calibration.correct`.
    arm
        Which arm it is: the name of one that is built in, such as "ur5e"; rows of Denavit and Hartenberg (n, 4) of a, alpha, d,
        theta, metres and radians; or the path of a URDF file, where that leaves a choice as (path, base link, tip link). Where
        it stands and what its tool is follow from the poses.
    robot_accuracy_mm
        How far the tip is from where the robot reports it, millimetres RMS over the region where it works: some tenths and more, not
        the repeatability of the data sheet. Where the arm is not given, `Calibration.reach_error_95_mm` follows from it.
    method
        joint, or one closed form: tsai_lenz, park_martin, horaud, andreff, daniilidis, shah, li.
    keep_outliers
        Keep views and corners that do not fit the others; otherwise they are left out, named in `views` and `findings`.
    free_scale
        Estimate the true size of the target, or with pose pairs the unit of their translations.
    goal_mm
        The expected error to reach, millimetres; a finding says whether it is.
    progress
        Called with what is being done and the part of it that is done, 0 to 1. Ctrl-C ends the work, as does an exception
        that it raises.

    Returns
    -------
    Calibration
        Transforms, covariances, expected error, findings. Other Python threads run while it is computed.

    Raises
    ------
    InputError
        A shape, a number or a combination that cannot be used; joint values that do not belong to the poses.
    CalibrationError
        Too few views (three at least), a robot that did not turn or turned about one axis only.

    Warns
    -----
    CalibrationWarning
        The arm of a data set is not used, or the controller counts with another chain than the arm's.
    """
    observations = _observations(
        dataset, corners, corner_ids, target, base_from_tip, camera_from_target, image_size, intrinsics,
        intrinsics_accuracy_px, intrinsics_start, lens_model, mode, names, joints, arm, robot_accuracy_mm,
    )
    if dataset is not None:
        _warn_of_unused(observations.joints_unused)
    document, sigmas, other_chain_m = _handeye.calibrate(
        observations, method, keep_outliers, free_scale, goal_mm, progress
    )
    if other_chain_m is not None:
        message = (
            f"the reported poses are {1e3 * other_chain_m:.3f} mm RMS from those of the arm by its joint values: the controller "
            "counts with another chain, such as its factory calibration, and the errors of the arm are not stated"
        )
        warnings.warn(message, CalibrationWarning, stacklevel=2)
    return Calibration._of(document, sigmas)


def calibrate_dataset(path: Union[str, "os.PathLike[str]"], *, method: str = "joint") -> Calibration:
    """Calibrates a dataset folder or session as `handeye calibrate` does: the same folder gives the same answer. Nothing is written
    and nothing is kept, so that any number of processes may do so at once.

    Images without a table of corners are searched by the program `handeye`, of this package or installed.

    Raises
    ------
    InputError
        As `load_dataset`; or there are images to be searched, and no program.
    CalibrationError
        As `calibrate`.
    """
    data = load_dataset(path)
    program = _program.find() if data._unsearched() else None
    if program is None:
        return calibrate(data, method=method, goal_mm=GOAL_MM)
    return Calibration._of(_program.calibrated(program, os.fspath(path), method), None)


def doctor(
    dataset: Optional[Dataset] = None,
    *,
    corners: Optional[Sequence[Any]] = None,
    corner_ids: Optional[Sequence[Any]] = None,
    target: Any = None,
    base_from_tip: Any = None,
    camera_from_target: Any = None,
    image_size: Optional[Tuple[int, int]] = None,
    intrinsics: Optional[Intrinsics] = None,
    intrinsics_accuracy_px: Optional[float] = None,
    intrinsics_start: Optional[Intrinsics] = None,
    lens_model: Optional[str] = None,
    mode: Optional[str] = None,
    names: Optional[Sequence[str]] = None,
    joints: Any = None,
    arm: Any = None,
    robot_accuracy_mm: Optional[float] = None,
    goal_mm: Optional[float] = None,
    progress: Optional[Progress] = None,
) -> Diagnosis:
    """Finds out what is wrong with the data: inverted poses, the wrong mode, millimetres for metres, images and poses out of
    step, a target of another size, a board or a camera that moved, views that contradict the others.

    It takes what `calibrate` takes, and answers where that has no answer too.

    Returns
    -------
    Diagnosis
        Findings, and the hypotheses that were tested. None of them is applied.

    Raises
    ------
    InputError
        A shape, a number or a combination that cannot be used.

    Warns
    -----
    CalibrationWarning
        Joint values are not used, because they do not belong to the poses: which of the two is wrong is what it looks for.
    """
    observations = _observations(
        dataset, corners, corner_ids, target, base_from_tip, camera_from_target, image_size, intrinsics,
        intrinsics_accuracy_px, intrinsics_start, lens_model, mode, names, joints, arm, robot_accuracy_mm,
    )
    _warn_of_unused(observations.joints_unused)
    return Diagnosis._of(*_handeye.diagnose(observations, goal_mm, progress))


def _warn_of_unused(why: Optional[str]) -> None:
    if why is not None:
        warnings.warn(f"joint values are not used: {why}", CalibrationWarning, stacklevel=3)


def _observations(
    dataset: Optional[Dataset],
    corners: Optional[Sequence[Any]],
    corner_ids: Optional[Sequence[Any]],
    target: Any,
    base_from_tip: Any,
    camera_from_target: Any,
    image_size: Optional[Tuple[int, int]],
    intrinsics: Optional[Intrinsics],
    intrinsics_accuracy_px: Optional[float],
    intrinsics_start: Optional[Intrinsics],
    lens_model: Optional[str],
    mode: Optional[str],
    names: Optional[Sequence[str]],
    joints: Any,
    arm: Any,
    robot_accuracy_mm: Optional[float],
) -> Any:
    if dataset is not None:
        rest = {
            "corners": corners, "corner_ids": corner_ids, "target": target, "base_from_tip": base_from_tip,
            "camera_from_target": camera_from_target, "image_size": image_size, "intrinsics": intrinsics,
            "intrinsics_accuracy_px": intrinsics_accuracy_px, "intrinsics_start": intrinsics_start, "lens_model": lens_model,
            "mode": mode, "names": names, "joints": joints, "arm": arm,
            "robot_accuracy_mm": robot_accuracy_mm,
        }
        given = [name for name, value in rest.items() if value is not None]
        if not isinstance(dataset, Dataset):
            raise InputError("the first argument is a data set of load_dataset; give arrays by their names")
        if given:
            raise InputError(
                f"a data set and {', '.join(given)}: a data set says all of it. To change something, pass its arrays by name"
            )
        return dataset._ready()
    if mode is not None and mode not in Modes:
        raise InputError(f"mode is {mode!r}, and must be 'eye_in_hand' or 'eye_to_hand'")
    if base_from_tip is not None and mode is None:
        raise InputError("mode is missing: say mode='eye_in_hand' (camera on the tip) or 'eye_to_hand' (target on the tip)")
    if base_from_tip is None and (mode is not None or camera_from_target is not None):
        raise InputError("base_from_tip is missing: the pose of the tip for each view")
    if corners is None and camera_from_target is None:
        raise InputError("give corners, or camera_from_target: what was seen of the target in each view")
    if corners is not None and camera_from_target is not None:
        raise InputError("both corners and camera_from_target: keep corners, from which the poses follow")
    if corners is not None and target is None:
        raise InputError("target is missing: a Target, or (M, 3) points of a grid, says what the corners are of")
    if corners is not None and image_size is None and intrinsics is None:
        raise InputError("image_size is missing: (width, height) in pixels")
    if intrinsics is not None and (intrinsics_start is not None or lens_model is not None):
        raise InputError("intrinsics are known and not estimated: leave intrinsics_start and lens_model out")
    if intrinsics_accuracy_px is not None:
        intrinsics_accuracy_px = float(intrinsics_accuracy_px)
        if intrinsics is None or camera_from_target is not None or not 1e-3 <= intrinsics_accuracy_px <= 1e3:
            raise InputError(
                "intrinsics_accuracy_px is a number of pixels between 0.001 and 1000, and goes with corners and intrinsics"
            )
    if robot_accuracy_mm is not None:
        robot_accuracy_mm = float(robot_accuracy_mm)
        if base_from_tip is None or not 1e-3 <= robot_accuracy_mm <= 100.0:
            raise InputError("robot_accuracy_mm is a number of millimetres between 0.001 and 100, and goes with base_from_tip")
    if (joints is None) != (arm is None):
        given, missing = ("joints", "arm") if arm is None else ("arm", "joints")
        raise InputError(
            f"{given} without {missing}: the errors of an arm need its joint values and which arm it is; give both or neither"
        )
    if joints is not None and base_from_tip is None:
        raise InputError("base_from_tip is missing: joints belong to poses of the tip")
    for what, lens in (("intrinsics", intrinsics), ("intrinsics_start", intrinsics_start)):
        if lens is None:
            continue
        if not isinstance(lens, Intrinsics):
            raise InputError(f"{what} is {type(lens).__name__}: make it with handeye.Intrinsics or Intrinsics.from_opencv")
        size = (lens.width, lens.height)
        if image_size is not None and size != tuple(image_size):
            raise InputError(f"{what} are of images of {size[0]} × {size[1]} pixels, and image_size is {tuple(image_size)}")
        image_size = size
    robot = None if base_from_tip is None else poses("base_from_tip", base_from_tip)
    seen = None if camera_from_target is None else poses("camera_from_target", camera_from_target)
    found = None if corners is None else corners_of_views(corners, corner_ids)
    turned = None if joints is None else joints_of_views(joints)
    of_views = {"base_from_tip": robot, "camera_from_target": seen, "corners": found, "joints": turned, "names": names}
    counts = {what: len(values) for what, values in of_views.items() if values is not None}
    if len(set(counts.values())) > 1:
        said = ", ".join(f"{count} in {what}" for what, count in counts.items())
        raise InputError(f"views do not match: {said}; one for each view is needed, in the same order")
    if target is not None and not isinstance(target, Target):
        target = Target.from_points(target)
    described = {
        "mode": mode,
        "target": None if target is None else target._document(),
        "image_size": None if image_size is None else [int(side) for side in image_size],
        "known": None if intrinsics is None else intrinsics._document(),
        "known_px": intrinsics_accuracy_px,
        "start": None if intrinsics_start is None else intrinsics_start._document(),
        "model": lens_model,
        "names": [str(n) for n in names] if names is not None else [f"view {i}" for i in range(max(counts.values()))],
        "arm": None if arm is None else described_arm(arm),
        "robot_accuracy_mm": robot_accuracy_mm,
    }
    return _handeye.Observations(
        json.dumps(described), None if robot is None else packed(robot), found, None if seen is None else packed(seen),
        None if turned is None else packed(turned),
    )
