"""Dataset folders, as docs/reference/dataset.md describes them."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any, List, Optional, Tuple, Union

import numpy as np

from . import _handeye
from ._arrays import Array, matrices
from ._errors import InputError
from ._types import Intrinsics, Target


@dataclass(frozen=True, eq=False)
class Dataset:
    """A dataset folder, read and checked. `calibrate` and `doctor` take it as it is; the arrays are for looking at, and for
    calls with something changed. All lists have one entry for each view, in the order of the pose table."""

    folder: str
    mode: Optional[str]
    """eye_in_hand or eye_to_hand; None when there is no robot."""
    target: Target
    image_size: Optional[Tuple[int, int]]
    """Width and height in pixels; None for pose pairs without images."""
    intrinsics: Optional[Intrinsics]
    """What `[camera]` says of fx … and distortion."""
    intrinsics_are_known: bool
    """Whether they are known; otherwise an estimate starts there."""
    intrinsics_accuracy_px: Optional[float]
    """How well, pixels; None where they are taken as exact."""
    names: List[str]
    """Of the views, as the pose table has them."""
    image_paths: List[Optional[str]]
    """Where the images are; None where only corners or target poses were kept."""
    base_from_tip: Optional[Array]
    """(N, 4, 4), metres; None without a robot."""
    camera_from_target: Optional[Array]
    """(N, 4, 4), metres, from a table of target poses; not finite in a view without a row; None without a table."""
    corners: Optional[List[Optional[Array]]]
    """(M, 2) pixels of each view from a corner table, None where the target was not found; None without a table."""
    corner_ids: Optional[List[Optional[Array]]]
    """(M,) which points of the target they are."""
    joints: Optional[List[Optional[Array]]]
    """Joint values of each view, radians or metres; None when the pose table has none."""
    robot_accuracy_mm: Optional[float]
    """How accurate the robot is, millimetres RMS; None where nothing is said of it."""
    notes: List[str]
    """What the tables name outside of the folder."""
    _observations: Any = field(repr=False)

    def _unsearched(self) -> int:
        """How many images the corners or target poses would come from."""
        if self.corners is not None or self.camera_from_target is not None:
            return 0
        return sum(path is not None for path in self.image_paths)

    def _ready(self) -> Any:
        """What is calibrated; images are not looked at by this module."""
        unsearched = self._unsearched()
        if unsearched:
            raise InputError(
                f"{self.folder} has {unsearched} images and no table of corners, and this module does not search images: find "
                "the corners with OpenCV and pass them (corners=, with base_from_tip and the rest of this data set), or run "
                f"`handeye calibrate {self.folder}`"
            )
        return self._observations


def load_dataset(path: Union[str, "os.PathLike[str]"]) -> Dataset:
    """Reads a dataset folder: dataset.toml, the pose table, and tables of corners or of target poses where there are some.

    Images are looked at for their size only: see `image_paths`. Nothing is guessed and nothing is dropped.

    Raises
    ------
    InputError
        On the first defect, with file and row, in the words of `handeye calibrate`.
    """
    observations, text, arrays = _handeye.read_folder(os.fspath(path))
    said = json.loads(text)

    def stack(name: str) -> Optional[Array]:
        return matrices(arrays[name]) if name in arrays else None

    corners: Optional[List[Optional[Array]]] = None
    corner_ids: Optional[List[Optional[Array]]] = None
    if "corners" in arrays:
        seen = arrays["corners"]
        corners = [None if c is None else np.frombuffer(c[1], dtype=np.float64).reshape(-1, 2) for c in seen]
        corner_ids = [None if c is None else np.frombuffer(c[0], dtype=np.int64) for c in seen]
    target = said["target"]
    joints: Optional[List[Optional[Array]]] = None
    if any(values is not None for values in said["joints_rad"]):
        joints = [None if values is None else np.array(values) for values in said["joints_rad"]]
    return Dataset(
        folder=os.fspath(path),
        mode=said["mode"],
        target=Target(target["kind"], {key: value for key, value in target.items() if key != "kind"}),
        image_size=None if said["image_size"] is None else (said["image_size"][0], said["image_size"][1]),
        intrinsics=Intrinsics._of(said["intrinsics"]),
        intrinsics_are_known=said["intrinsics_are_known"],
        intrinsics_accuracy_px=said["intrinsics_accuracy_px"],
        names=said["names"],
        image_paths=said["image_paths"],
        base_from_tip=stack("base_from_tip"),
        camera_from_target=stack("camera_from_target"),
        corners=corners,
        corner_ids=corner_ids,
        joints=joints,
        robot_accuracy_mm=said["robot_accuracy_mm"],
        notes=said["notes"],
        _observations=observations,
    )
