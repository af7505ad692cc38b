"""The errors of a robot's arm, and commands that allow for them."""

from __future__ import annotations

import json
import os
import warnings
from dataclasses import dataclass
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from . import _handeye
from ._arrays import Array, covariance, floats, matrices, packed, transform
from ._errors import CalibrationWarning, InputError
from ._types import Intrinsics

CONTRADICTED = (
    "views left out of the calibration are predicted worse by corrected poses than by reported ones: do not correct before more "
    "views agree"
)


@dataclass(frozen=True)
class JointErrors:
    """What is off about one joint, each number with its standard deviation. None is what no view can tell from the transforms:
    all of the first joint, and the zero of the last."""

    name: str
    tilt_deg: Optional[Tuple[float, float]]
    """Direction of its axis: rotation about x and y of its frame, degrees."""
    tilt_sigma_deg: Optional[Tuple[float, float]]
    zero_deg: Optional[float]
    """Its zero, to be added to the reported angle, degrees."""
    zero_sigma_deg: Optional[float]
    shift_mm: Optional[Tuple[float, float]]
    """Place of its axis along x and y of its frame, millimetres."""
    shift_sigma_mm: Optional[Tuple[float, float]]
    compliance_deg: Optional[float]
    """What it gives way by where gravity turns it with all the weight behind it, degrees."""
    compliance_sigma_deg: Optional[float]


@dataclass(frozen=True)
class ArmLevels:
    """How large errors of their kind are in this arm, as standard deviations."""

    angle_deg: float
    """Of tilts and zeros."""
    length_mm: float
    """Of shifts."""
    compliance_deg: float
    """Of compliances."""


@dataclass(frozen=True, eq=False)
class Arm:
    """The errors of the robot's arm as the images show them, and the transforms that go with corrected poses."""

    joints: List[JointErrors]
    """From the base to the tip."""
    levels: ArmLevels
    unexplained_mm: float
    """What of the robot's error they do not explain, one standard deviation per axis of the position."""
    unexplained_deg: float
    """The same of the orientation."""
    hand_eye: Array
    """The camera on its mount, (4, 4), as `Calibration.hand_eye` has it, to be used with corrected poses alone."""
    target: Array
    """The target on its mount, (4, 4), likewise."""
    intrinsics: Optional[Intrinsics]
    """The lens that goes with hand_eye: estimated with the arm it is another one than `Calibration.intrinsics`."""
    hand_eye_covariance: Optional[Array]
    """Of hand_eye, (6, 6)."""
    target_covariance: Optional[Array]
    """Of target, (6, 6)."""
    reach_error_95_mm: Optional[float]
    """How far from a point that the camera saw the tip of a tool arrives by the controller as it is: 95 % are below. The tool is
    `tool_m` of a data set, or 100 mm along z of the tip. None where it cannot be stated."""
    reach_error_corrected_95_mm: Optional[float]
    """The same by corrected poses and commands."""
    heldout_px: Optional[Tuple[float, float]]
    """RMS of the corners of views left out, predicted by reported and by corrected poses, pixels."""
    contradicted: bool
    """Whether views left out contradict the errors, being predicted worse by corrected poses than chance and the model explain: then do
    not correct."""

    @classmethod
    def _of(cls, document: Mapping[str, Any]) -> Optional[Arm]:
        arm, quality = document.get("arm"), document["quality"]
        if arm is None:
            return None
        heldout = arm["heldout_px"]
        return cls(
            joints=[_joint(joint) for joint in arm["joints"]],
            levels=ArmLevels(**{key: arm["levels"][key] for key in ("angle_deg", "length_mm", "compliance_deg")}),
            unexplained_mm=arm["unexplained"]["translation_mm"],
            unexplained_deg=arm["unexplained"]["rotation_deg"],
            hand_eye=transform(arm["hand_eye"]),
            target=transform(arm["target"]),
            intrinsics=Intrinsics._of(arm.get("intrinsics")),
            hand_eye_covariance=covariance(arm["hand_eye"]),
            target_covariance=covariance(arm["target"]),
            reach_error_95_mm=quality.get("reach_error_95_mm"),
            reach_error_corrected_95_mm=quality.get("reach_error_corrected_95_mm"),
            heldout_px=None if heldout is None else (heldout["reported"], heldout["corrected"]),
            contradicted=arm["contradicted"],
        )


def _joint(document: Mapping[str, Any]) -> JointErrors:
    keys = ("tilt_deg", "zero_deg", "shift_mm", "compliance_deg")
    values: Dict[str, Any] = {}
    for key in keys:
        what, unit = key.split("_")
        for name in (key, f"{what}_sigma_{unit}"):
            value = document[name]
            values[name] = tuple(value) if isinstance(value, list) else value
    return JointErrors(name=document["name"], **values)


@dataclass(frozen=True, eq=False)
class Command:
    """What to command so that the tip really is where it is wanted. Of a stack of N poses each is an array of N."""

    joints: Array
    """Joint values, (n,) or (N, n), radians."""
    base_from_tip: Array
    """The same as the controller's own kinematics has it, (4, 4) or (N, 4, 4): what to command by poses."""
    error_95_mm: Union[float, Array]
    """The distance that the tip stays under from where it is wanted, with a probability of 95 %, millimetres."""


@dataclass(frozen=True, eq=False)
class TipPose:
    """Where the tip really is. Of a stack of N rows of joint values each is an array of N."""

    base_from_tip: Array
    """(4, 4) or (N, 4, 4)."""
    error_95_mm: Union[float, Array]
    """The distance that the tip stays under from there, with a probability of 95 %, millimetres."""


def correct(document: Mapping[str, Any], pose: Any, near: Any) -> Command:
    """`Calibration.correct`."""
    arm = _corrected(document)
    wanted = floats("pose", pose)
    if wanted.ndim not in (2, 3) or wanted.shape[-2:] != (4, 4):
        raise InputError(f"pose has shape {wanted.shape}, and is (4, 4), or (N, 4, 4) for many")
    one = wanted.ndim == 2
    wanted = wanted.reshape(-1, 4, 4)
    start = None
    if near is not None:
        values = floats("near", near)
        if values.shape not in ((arm.joint_count,), (len(wanted), arm.joint_count)):
            raise InputError(
                f"near has shape {values.shape}, and is ({arm.joint_count},) or ({len(wanted)}, {arm.joint_count}): joint values, "
                "radians"
            )
        if not np.isfinite(values).all():
            raise InputError("near has a value that is not finite: give joint values in radians, or leave it out")
        start = packed(values)
    names = ["pose"] if one else [f"pose[{row}]" for row in range(len(wanted))]
    found = arm.commands(packed(wanted), start, names)
    joints = np.frombuffer(found[0], dtype=np.float64).reshape(-1, arm.joint_count)
    tips, errors = matrices(found[1]), 1e3 * np.frombuffer(found[2], dtype=np.float64)
    return Command(joints[0], tips[0], float(errors[0])) if one else Command(joints, tips, errors)


def actual(document: Mapping[str, Any], joints: Any) -> TipPose:
    """`Calibration.actual`."""
    arm = _corrected(document)
    values = floats("joints", joints)
    if values.ndim not in (1, 2) or values.shape[-1] != arm.joint_count:
        raise InputError(f"joints have shape {values.shape}, and are ({arm.joint_count},) or (N, {arm.joint_count}), radians")
    one = values.ndim == 1
    names = ["joints"] if one else [f"joints[{row}]" for row in range(len(values))]
    found = arm.actual(packed(values), names)
    tips, errors = matrices(found[0]), 1e3 * np.frombuffer(found[1], dtype=np.float64)
    return TipPose(tips[0], float(errors[0])) if one else TipPose(tips, errors)


def _corrected(document: Mapping[str, Any]) -> _handeye.CorrectedArm:
    arm = document.get("arm")
    if arm is None:
        raise InputError(
            "this calibration knows no errors of an arm: calibrate with joints= and arm=, or a data set that has both, whose "
            "reported poses are those of the arm"
        )
    if arm["contradicted"]:
        warnings.warn(CONTRADICTED, CalibrationWarning, stacklevel=4)
    return _handeye.CorrectedArm(json.dumps(arm))


def described(arm: Any) -> Dict[str, Any]:
    """What `arm=` says, as the compiled part takes it."""
    if isinstance(arm, tuple) and len(arm) == 3 and isinstance(arm[0], (str, os.PathLike)):
        path, base, tip = arm
        return {"urdf": {"path": os.fspath(path), "base": base, "tip": tip}}
    if isinstance(arm, (str, os.PathLike)):
        name = os.fspath(arm)
        is_file = not isinstance(arm, str) or name.lower().endswith((".urdf", ".xml", ".xacro")) or os.path.exists(name)
        return {"urdf": {"path": name, "base": None, "tip": None}} if is_file else {"kind": name}
    rows = floats("arm", arm)
    if rows.ndim != 2 or rows.shape[1] != 4:
        raise InputError(f"arm has shape {rows.shape}, and rows are (n, 4): a, alpha, d, theta of each joint, metres and radians")
    if not np.isfinite(rows).all():
        raise InputError("arm has a number that is not finite")
    return {"dh": rows.tolist()}
