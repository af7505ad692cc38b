"""Robots and cameras that move and have clocks of their own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Tuple

import numpy as np

from . import _handeye
from ._arrays import Array, floats, matrices, packed, poses
from ._errors import InputError


@dataclass(frozen=True)
class ClockOffset:
    """How far the clocks of a robot and a camera are apart."""

    offset_s: float
    """What is added to a stamp of the camera to have it by the robot's clock, seconds."""
    sigma_s: float
    """Its standard deviation, seconds, for errors of the poses that are independent of each other."""


def clock_offset(
    robot_stamps: Any, base_from_tip: Any, camera_stamps: Any, camera_from_target: Any, *, mode: str, within_s: float = 1.0
) -> ClockOffset:
    """The offset between the clocks of a robot and a camera, from what both saw of a motion.

    Needs both while the robot moves: turning about several axes, with changes of speed, and not in a motion that repeats
    itself within the offsets that are looked for. Where the robot stands still at every view no common clock is needed.

    Parameters
    ----------
    robot_stamps, base_from_tip
        (N,) seconds by the robot's clock, rising, and (N, 4, 4).
    camera_stamps, camera_from_target
        (M,) seconds by the camera's clock, rising, and (M, 4, 4). Leave out images without the target.
    mode
        "eye_in_hand" or "eye_to_hand".
    within_s
        The offset is looked for this far on both sides of zero, seconds.

    Raises
    ------
    InputError
        For shapes, and for stamps that do not rise.
    CalibrationError
        Where the motion does not tell the offset, or several fit.
    """
    if mode not in ("eye_in_hand", "eye_to_hand"):
        raise InputError(f'mode is {mode!r}, and is "eye_in_hand" or "eye_to_hand"')
    robot, camera = poses("base_from_tip", base_from_tip), poses("camera_from_target", camera_from_target)
    stamps = stamps_of("robot_stamps", robot_stamps, len(robot)), stamps_of("camera_stamps", camera_stamps, len(camera))
    if not (np.isfinite(within_s) and within_s > 0):
        raise InputError(f"within_s is {within_s}, and is a number of seconds above 0")
    carrier = robot if mode == "eye_in_hand" else np.linalg.inv(robot)
    found = _handeye.clock_offset(
        packed(stamps[0]), packed(carrier), packed(stamps[1]), packed(camera), float(within_s)
    )
    return ClockOffset(*found)


def poses_at(times: Any, robot_stamps: Any, base_from_tip: Any) -> Tuple[Array, Array]:
    """The robot's poses at other times by its clock, such as `camera_stamps + offset_s`.

    Between two stamps the tip turns evenly and moves straight. Returns (M, 4, 4), and (M,) of booleans: whether each time is
    within the stream; poses of those outside mean nothing.
    """
    robot = poses("base_from_tip", base_from_tip)
    stamps = stamps_of("robot_stamps", robot_stamps, len(robot))
    if not (np.diff(stamps) > 0).all():
        raise InputError("robot_stamps do not rise: sort them, and leave doubled ones out")
    data, within = _handeye.poses_at(packed(floats("times", times).reshape(-1)), packed(stamps), packed(robot))
    return matrices(data), np.array(within, dtype=bool)


def stamps_of(what: str, value: Any, count: int) -> Array:
    """Stamps, one for each pose."""
    stamps = floats(what, value)
    if stamps.shape != (count,):
        raise InputError(f"{what} has shape {stamps.shape}, and is ({count},): one for each pose")
    return stamps
