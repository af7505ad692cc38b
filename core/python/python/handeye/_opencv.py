"""OpenCV's hand-eye functions, with their argument order and conventions, for those who lost them with OpenCV 5."""

from __future__ import annotations

import warnings
from typing import Any, List, Sequence, Tuple, Union

import numpy as np

from . import _handeye
from ._arrays import Array, floats, matrices, packed
from ._calibrate import calibrate
from ._errors import CalibrationWarning, InputError

# By OpenCV's constants CALIB_HAND_EYE_…
HAND_EYE = ("tsai_lenz", "park_martin", "horaud", "andreff", "daniilidis")
# And CALIB_ROBOT_WORLD_HAND_EYE_…
ROBOT_WORLD = ("shah", "li")
SHORT = {"tsai": "tsai_lenz", "park": "park_martin"}
ALL = HAND_EYE + ROBOT_WORLD


def calibrate_hand_eye(
    R_gripper2base: Sequence[Any],
    t_gripper2base: Sequence[Any],
    R_target2cam: Sequence[Any],
    t_target2cam: Sequence[Any],
    method: Union[str, int] = "pose_pairs",
) -> Tuple[Array, Array]:
    """The camera on the gripper from N pose pairs, as OpenCV 4's calibrateHandEye answers it.

    Parameters
    ----------
    R_gripper2base, t_gripper2base
        The gripper in the base for each view: rotations as (3, 3) or as rotation vectors of 3, translations of 3. For a
        camera that stands still pass base2gripper here; cam2base comes out.
    R_target2cam, t_target2cam
        The target in the camera for each view.
    method
        "pose_pairs", which is not one of OpenCV's: the estimate that weights rotations and translations by their scatter and
        leaves outliers out. Or a closed form, which gives OpenCV's numbers: "tsai", "park", "horaud", "andreff",
        "daniilidis", or OpenCV's constant 0 to 4; also "shah" and "li". Unlike OpenCV's fifth argument, which is an output,
        this one may be given by its position.

    Returns
    -------
    R_cam2gripper, t_cam2gripper
        (3, 3) and (3, 1), in the unit of the translations.

    Raises
    ------
    InputError
        A shape or a number that cannot be used; an unknown method.
    CalibrationError
        Fewer than three views; no rotation, or turns about one axis only, which OpenCV answers with some number.

    Warns
    -----
    CalibrationWarning
        "pose_pairs" left views out, or found that the answer is not to be used. `calibrate` has the details, and says how
        well the answer is known.
    """
    robot = _poses("gripper2base", R_gripper2base, t_gripper2base)
    target = _poses("target2cam", R_target2cam, t_target2cam)
    mount_from_camera, _ = _solve(robot, target, method, HAND_EYE)
    return mount_from_camera[:3, :3].copy(), mount_from_camera[:3, 3:].copy()


def calibrate_robot_world_hand_eye(
    R_world2cam: Sequence[Any],
    t_world2cam: Sequence[Any],
    R_base2gripper: Sequence[Any],
    t_base2gripper: Sequence[Any],
    method: Union[str, int] = "pose_pairs",
) -> Tuple[Array, Array, Array, Array]:
    """Both links from N pose pairs, as OpenCV 4's calibrateRobotWorldHandEye answers it.

    Parameters
    ----------
    R_world2cam, t_world2cam
        The world, which is the target, in the camera for each view.
    R_base2gripper, t_base2gripper
        The base in the gripper for each view: the inverse of what `calibrate_hand_eye` takes.
    method
        As there; OpenCV's constants are 0 for "shah" and 1 for "li" here.

    Returns
    -------
    R_base2world, t_base2world, R_gripper2cam, t_gripper2cam
        (3, 3), (3, 1), (3, 3), (3, 1).

    Raises
    ------
    InputError, CalibrationError
        As there.
    """
    target = _poses("world2cam", R_world2cam, t_world2cam)
    robot = _inverse(_poses("base2gripper", R_base2gripper, t_base2gripper))
    tip_from_camera, base_from_target = _solve(robot, target, method, ROBOT_WORLD)
    world, gripper = _inverse(base_from_target[None])[0], _inverse(tip_from_camera[None])[0]
    return world[:3, :3].copy(), world[:3, 3:].copy(), gripper[:3, :3].copy(), gripper[:3, 3:].copy()


def _solve(
    robot: Array, target: Array, method: Union[str, int], constants: Tuple[str, ...]
) -> Tuple[Array, Array]:
    if len(robot) != len(target):
        raise InputError(f"{len(robot)} poses of the robot and {len(target)} of the target: one of each for every view")
    name = _method(method, constants)
    if name != "pose_pairs":
        views = [f"view {i}" for i in range(len(robot))]
        found = _handeye.closed_form(name, packed(robot), packed(target), views)
        return matrices(found[0])[0], matrices(found[1])[0]
    result = calibrate(base_from_tip=robot, camera_from_target=target, mode="eye_in_hand")
    outliers = [view.name for view in result.views if view.status == "outlier"]
    if outliers:
        message = f"left out, because they contradict the others: {', '.join(outliers)}"
        warnings.warn(message, CalibrationWarning, stacklevel=3)
    if result.problem is not None:
        warnings.warn(str(result.problem), CalibrationWarning, stacklevel=3)
    assert result.tip_from_camera is not None and result.base_from_target is not None
    return result.tip_from_camera, result.base_from_target


def _method(method: Union[str, int], constants: Tuple[str, ...]) -> str:
    if isinstance(method, (int, np.integer)) and not isinstance(method, bool):
        if not 0 <= method < len(constants):
            numbered = ", ".join(f"{i} {name}" for i, name in enumerate(constants))
            raise InputError(f"no method {method}: {numbered}")
        return constants[method]
    if isinstance(method, str):
        name = SHORT.get(method.lower(), method.lower())
        if name in ("pose_pairs", *ALL):
            return name
    raise InputError(f"no method {method!r}: 'pose_pairs', {', '.join(map(repr, ALL))}, or OpenCV's constant")


def _poses(what: str, rotations: Sequence[Any], translations: Sequence[Any]) -> Array:
    """(N, 4, 4) of OpenCV's lists."""
    if len(rotations) != len(translations):
        raise InputError(f"R_{what} has {len(rotations)} views and t_{what} {len(translations)}")
    out: List[Array] = []
    for index, (rotation, translation) in enumerate(zip(rotations, translations)):
        r, t = floats(f"R_{what}[{index}]", rotation), floats(f"t_{what}[{index}]", translation)
        if r.shape != (3, 3) and r.size != 3:
            raise InputError(f"R_{what}[{index}] has shape {r.shape}: (3, 3), or a rotation vector of 3")
        if t.size != 3:
            raise InputError(f"t_{what}[{index}] has shape {t.shape}, and a translation has 3 numbers")
        pose = np.eye(4)
        pose[:3, :3] = r if r.shape == (3, 3) else _rodrigues(r.reshape(3))
        pose[:3, 3] = t.reshape(3)
        out.append(pose)
    return np.array(out).reshape(-1, 4, 4)


def _rodrigues(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # Both quotients are exact to the last digit where the angle is too small to square.
    first = np.sin(angle) / angle if angle > 1e-8 else 1.0
    second = (1.0 - np.cos(angle)) / angle**2 if angle > 1e-4 else 0.5
    out: Array = np.eye(3) + first * skew + second * (skew @ skew)
    return out


def _inverse(poses: Array) -> Array:
    out = np.tile(np.eye(4), (len(poses), 1, 1))
    turned = np.swapaxes(poses[:, :3, :3], 1, 2)
    out[:, :3, :3] = turned
    out[:, :3, 3] = -(turned @ poses[:, :3, 3:])[:, :, 0]
    return out
