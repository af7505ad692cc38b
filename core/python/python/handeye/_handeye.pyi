"""The compiled part: arrays are bytes of doubles in the order of C, small things JSON."""

from os import PathLike
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

__version__: str

class Observations:
    def __new__(
        cls,
        description: str,
        base_from_tip: Optional[bytes],
        corners: Optional[List[Optional[Tuple[Optional[bytes], bytes]]]],
        camera_from_target: Optional[bytes],
        joints: Optional[bytes],
    ) -> Observations: ...
    @property
    def joints_unused(self) -> Optional[str]: ...

class CorrectedArm:
    def __new__(cls, arm: str) -> CorrectedArm: ...
    @property
    def joint_count(self) -> int: ...
    def commands(self, wanted: bytes, near: Optional[bytes], names: List[str]) -> Tuple[bytes, bytes, bytes]: ...
    def actual(self, joints: bytes, names: List[str]) -> Tuple[bytes, bytes]: ...

def calibrate(
    observations: Observations,
    method: str,
    keep_outliers: bool,
    free_scale: bool,
    goal_mm: Optional[float],
    progress: Optional[Callable[[str, float], Any]],
) -> Tuple[str, Optional[Tuple[float, float]], Optional[float]]: ...
def diagnose(
    observations: Observations, goal_mm: Optional[float], progress: Optional[Callable[[str, float], Any]]
) -> Tuple[str, str, bool]: ...
def closed_form(
    method: str, anchor_from_mount: bytes, camera_from_target: bytes, names: List[str]
) -> Tuple[bytes, bytes]: ...
def clock_offset(
    robot_stamps_s: bytes, anchor_from_mount: bytes, camera_stamps_s: bytes, camera_from_target: bytes, within_s: float
) -> Tuple[float, float]: ...
def poses_at(times_s: bytes, stamps_s: bytes, base_from_tip: bytes) -> Tuple[bytes, List[bool]]: ...
def read_folder(folder: Union[str, "PathLike[str]"]) -> Tuple[Observations, str, Dict[str, Any]]: ...
def read_result(path: Union[str, "PathLike[str]"]) -> str: ...
def target_points(target: str) -> bytes: ...
