"""Hand-eye calibration that says how accurate it is.

`calibrate` takes corners or pose pairs as numpy arrays, `calibrate_hand_eye` the arguments of OpenCV's calibrateHandEye,
`calibrate_dataset` a folder; `doctor` says what is wrong with the data, `clock_offset` relates two clocks, `load_dataset` reads
a dataset folder, `load_calibration` a result. Transforms are 4 × 4 arrays named `dst_from_src`, lengths metres, angles radians
and pixels OpenCV's, unless a name says otherwise.
"""

from ._arm import Arm, ArmLevels, Command, JointErrors, TipPose
from ._calibrate import calibrate, calibrate_dataset, doctor
from ._clocks import ClockOffset, clock_offset, poses_at
from ._dataset import Dataset, load_dataset
from ._errors import CalibrationError, CalibrationWarning, HandeyeError, InputError
from ._handeye import __version__
from ._opencv import calibrate_hand_eye, calibrate_robot_world_hand_eye
from ._result import Calibration, Diagnosis, Hypothesis, View, load_calibration
from ._types import Finding, Intrinsics, Target

__all__ = [
    "Arm",
    "ArmLevels",
    "Calibration",
    "CalibrationError",
    "CalibrationWarning",
    "ClockOffset",
    "Command",
    "Dataset",
    "Diagnosis",
    "Finding",
    "HandeyeError",
    "Hypothesis",
    "InputError",
    "Intrinsics",
    "JointErrors",
    "Target",
    "TipPose",
    "View",
    "__version__",
    "calibrate",
    "calibrate_dataset",
    "calibrate_hand_eye",
    "calibrate_robot_world_hand_eye",
    "clock_offset",
    "doctor",
    "load_calibration",
    "load_dataset",
    "poses_at",
]
