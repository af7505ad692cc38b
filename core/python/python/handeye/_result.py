"""A calibration and a diagnosis, out of their documents."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Tuple, Union

import numpy as np

from . import _handeye
from ._arm import Arm, Command, TipPose, actual, correct
from ._arrays import Array, covariance, transform
from ._types import Finding, Intrinsics, findings_of


@dataclass(frozen=True)
class View:
    """What became of one view."""

    name: str
    status: str
    """used, outlier (it contradicts the others and was left out) or no_target."""
    rms_px: Optional[float]
    """Root mean square distance of its corners from where they are predicted, pixels; None for pose pairs."""
    influence_mm: Optional[float]
    """How far the camera's place moves without this view, millimetres."""
    distance: Optional[float]
    """How far it is from what the other views expect, over the limit from which it is left out."""
    corners_left_out: Tuple[int, ...]
    """Numbers of corners that were left out as outliers."""
    renumbered: bool
    """Whether its target was numbered from the other end than given."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """The answer of `calibrate`.

    A transform `dst_from_src` is a 4 × 4 array that maps points in `src` to points in `dst`, metres. A covariance is that of
    `[tx ty tz rx ry rz]` in `dst_from_src * exp(delta)`: in the axes of `src`, metres and radians. A number that is not
    known is None.
    """

    mode: Optional[str]
    """eye_in_hand or eye_to_hand; None when there was no robot and only the camera was calibrated."""
    tip_from_camera: Optional[Array]
    """Eye in hand: the camera on the robot's tip, (4, 4)."""
    base_from_target: Optional[Array]
    """Eye in hand: the target in the robot's base, (4, 4)."""
    base_from_camera: Optional[Array]
    """Eye to hand: the camera in the robot's base, (4, 4)."""
    tip_from_target: Optional[Array]
    """Eye to hand: the target on the robot's tip, (4, 4)."""
    hand_eye_covariance: Optional[Array]
    """Of tip_from_camera or base_from_camera, (6, 6); None for a closed form."""
    target_covariance: Optional[Array]
    """Of base_from_target or tip_from_target, (6, 6); None for a closed form."""
    tip_error_95_mm: Optional[float]
    """Expected error of a point that is measured where the camera saw the target: 95 % of errors are below, millimetres.
    None for pose pairs (nothing says where points are measured) and where a finding is a problem."""
    reach_error_95_mm: Optional[float]
    """How far from a point that the camera saw the tip of a tool arrives by the controller as it is: 95 % are below, millimetres. By the
    errors of the arm, or where it is not given by the accuracy of the robot; None where neither is known, and where a finding is a
    problem. With an arm,
    `Calibration.arm` has it by corrected commands too."""
    robot_accuracy_mm: Optional[float]
    """The stated accuracy of the robot that it follows from; None otherwise."""
    rms_px: Optional[float]
    """Root mean square residual of the corners. How well the model fits, not how accurate it is."""
    heldout_rms_px: Optional[float]
    """The same of views that were held out of the fit."""
    corner_sigma_px: Optional[float]
    """Estimated noise of a corner coordinate."""
    robot_sigma_mm: Optional[float]
    """Estimated noise of the robot's positions per axis; None for pose pairs."""
    robot_sigma_deg: Optional[float]
    """Estimated noise of the robot's rotations per axis; None for pose pairs."""
    pair_sigma_mm: Optional[float]
    """Pose pairs: disagreement of robot and target poses per axis. From pairs alone the two cannot be told apart."""
    pair_sigma_deg: Optional[float]
    """The same of rotations."""
    intrinsics: Optional[Intrinsics]
    """The camera, estimated or as given; None for pose pairs without one."""
    intrinsics_are_known: bool
    """Whether they were given and not estimated."""
    views: List[View]
    """One for each view, in the order given."""
    findings: List[Finding]
    """What is weak or wrong, the most severe first."""
    arm: Optional[Arm]
    """The errors of the robot's arm, and the transforms that go with corrected poses; None where its joints are not known, for pose
    pairs and for a closed form."""
    methods: Dict[str, Optional[Array]]
    """What the closed forms say, by name: the hand-eye transform (4, 4), None where one failed."""
    document: Mapping[str, Any] = field(repr=False)
    """All of it, in the layout of handeye-calibration-1.schema.json."""
    _json: str = field(repr=False)

    @property
    def hand_eye(self) -> Optional[Array]:
        """tip_from_camera or base_from_camera, whichever the mode has."""
        return self.tip_from_camera if self.mode == "eye_in_hand" else self.base_from_camera

    @property
    def problem(self) -> Optional[Finding]:
        """The first finding because of which the answer is not to be used; None when there is none."""
        return next((finding for finding in self.findings if finding.severity == "problem"), None)

    def correct(self, pose: Any, near: Any = None) -> Command:
        """What to command so that the tip really is at `pose`, by the errors of the arm. Moves nothing.

        Parameters
        ----------
        pose
            base_from_tip that is wanted, (4, 4) or (N, 4, 4), metres. A pose that the camera gave comes from `arm.hand_eye`,
            `arm.intrinsics` and `actual`, not from `hand_eye`, `intrinsics` and reported poses.
        near
            Joint values near which the arm shall be, (n,) or (N, n), radians: of several ways to reach a pose the nearest is taken.
            Where a pose has none, those of the pose before; the search for the first begins in the middle of the ranges.

        Raises
        ------
        InputError
            The calibration knows no errors of an arm; a shape; a pose that the arm does not reach, with its row.

        Warns
        -----
        CalibrationWarning
            Where `arm.contradicted`.
        """
        return correct(self.document, pose, near)

    def actual(self, joints: Any) -> TipPose:
        """Where the tip really is when the controller reports `joints`, (n,) or (N, n) radians.

        Raises
        ------
        InputError
            The calibration knows no errors of an arm; a shape; a value that is not finite, with its row.

        Warns
        -----
        CalibrationWarning
            Where `arm.contradicted`.
        """
        return actual(self.document, joints)

    def to_json(self) -> str:
        """The result document that `handeye calibrate --json` writes, which `handeye export` and `handeye track` read."""
        return self._json

    @classmethod
    def _of(cls, text: str, sigmas: Optional[Tuple[float, float]]) -> Calibration:
        document = json.loads(text)
        links: Dict[str, Array] = {}
        covariances = {}
        for key in ("hand_eye", "target"):
            link = document[key]
            if link is not None:
                links[f"{link['parent_frame']}_from_{link['child_frame']}"] = transform(link)
                covariances[key] = covariance(link)
        quality, camera = document["quality"], document["intrinsics"]
        return cls(
            mode=document["mode"],
            tip_from_camera=links.get("tip_from_camera"),
            base_from_target=links.get("base_from_target"),
            base_from_camera=links.get("base_from_camera"),
            tip_from_target=links.get("tip_from_target"),
            hand_eye_covariance=covariances.get("hand_eye"),
            target_covariance=covariances.get("target"),
            tip_error_95_mm=quality["tip_error_95_mm"],
            reach_error_95_mm=quality.get("reach_error_95_mm"),
            robot_accuracy_mm=quality.get("robot_accuracy_mm"),
            rms_px=quality["rms_px"],
            heldout_rms_px=quality["heldout_rms_px"],
            corner_sigma_px=quality["sigma_px"],
            robot_sigma_mm=quality["robot_sigma_mm"],
            robot_sigma_deg=quality["robot_sigma_deg"],
            pair_sigma_mm=None if sigmas is None else sigmas[0] * 1e3,
            pair_sigma_deg=None if sigmas is None else float(np.degrees(sigmas[1])),
            intrinsics=Intrinsics._of(camera),
            intrinsics_are_known=bool(camera and camera["fixed"]),
            views=[
                View(
                    view["name"], view["status"], view["rms_px"], view["influence_mm"], view["distance"],
                    tuple(view["corners_aside"]), view["renumbered"],
                )
                for view in document["views"]
            ],
            findings=findings_of(document["findings"]),
            arm=Arm._of(document),
            methods={m["name"]: transform(m) if m["status"] == "ok" else None for m in document["methods"]},
            document=document,
            _json=text,
        )


def load_calibration(path: Union[str, "os.PathLike[str]"]) -> Calibration:
    """Reads a result: a file of `Calibration.to_json` or `handeye calibrate --json`, or a session or dataset folder with a
    result.json. The disagreement of pose pairs is not in it, and None.

    Raises
    ------
    InputError
        No file, or another than a result, with its name.
    """
    file = os.fspath(path)
    if os.path.isdir(file):
        file = os.path.join(file, "result.json")
    return Calibration._of(_handeye.read_result(file), None)


@dataclass(frozen=True)
class Hypothesis:
    """Something that may be wrong with the data, and how much better it explains them. None is applied."""

    code: str
    with_: Tuple[str, ...]
    """What has to be changed together with it, or what explains the data just as well."""
    message: str
    advice: str
    gain: float
    """Natural logarithm of how many times better it explains the data."""
    estimate: Optional[Tuple[str, float, Optional[float], str]]
    """What it estimates: name, value, one standard deviation, unit."""
    views: Tuple[str, ...]
    significant: bool
    """Whether chance is ruled out."""
    accepted: bool
    """Whether it is also large enough to matter, and is among the findings."""


@dataclass(frozen=True)
class Diagnosis:
    """The answer of `doctor`."""

    findings: List[Finding]
    """The most severe first; accepted hypotheses are among them."""
    hypotheses: List[Hypothesis]
    """What was tested: accepted ones first, then the best of every other kind."""
    untested: Optional[str]
    """Why hypotheses could not be tested; None when they were."""
    is_healthy: bool
    """Whether nothing was found that may spoil the answer."""
    report: str = field(repr=False)
    """The page of text that `handeye doctor` prints."""
    _json: str = field(repr=False)

    def to_json(self) -> str:
        """The document that `handeye doctor --json` writes."""
        return self._json

    @classmethod
    def _of(cls, text: str, report: str, is_healthy: bool) -> Diagnosis:
        document = json.loads(text)

        def hypothesis(h: Mapping[str, Any]) -> Hypothesis:
            e = h["estimate"]
            estimate = None if e is None else (e["name"], e["value"], e["sigma"], e["unit"])
            return Hypothesis(
                h["code"], tuple(h["with"]), h["text"], h["advice"], h["gain"], estimate, tuple(h["views"]),
                h["significant"], h["accepted"],
            )

        hypotheses = [hypothesis(h) for h in document["hypotheses"]]
        return cls(findings_of(document["findings"]), hypotheses, document["untested"], is_healthy, report, text)
