"""What goes in and what comes out."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from . import _handeye
from ._arrays import Array, floats
from ._errors import InputError


@dataclass(frozen=True)
class Target:
    """A printed target. Its points lie in the plane z = 0 of the target frame: x along columns, y along rows, z into the
    board, away from who looks at it; they are numbered row by row, and the first point is the origin.

    Make one with `chessboard`, `charuco`, `circles`, `asymmetric_circles`, `aprilgrid`, `apriltag` or `from_points`.
    """

    kind: str
    """As in dataset.toml: chessboard, charuco, circles, asymmetric_circles, aprilgrid, apriltag."""
    keys: Mapping[str, Any] = field(default_factory=dict)
    """The other keys of the table `[target]` of a dataset folder."""

    def __post_init__(self) -> None:
        _handeye.target_points(self._json())

    def _json(self) -> str:
        return json.dumps(self._document())

    def _document(self) -> Dict[str, Any]:
        return {"kind": self.kind, **self.keys}

    @property
    def points(self) -> Array:
        """All points, (N, 3), metres in the target frame."""
        return np.frombuffer(_handeye.target_points(self._json()), dtype=np.float64).reshape(-1, 3)

    @classmethod
    def chessboard(cls, columns: int, rows: int, square_m: float) -> Target:
        """`columns` × `rows` inner corners, `square_m` metres apart. The square between corners (0, 0), (1, 0), (0, 1) and
        (1, 1) is dark. Where columns and rows add up to an even number the board looks the same after half a turn, and
        views that were numbered from the other end are recognised by the robot's motion."""
        return cls("chessboard", {"columns": int(columns), "rows": int(rows), "square_m": float(square_m)})

    @classmethod
    def circles(cls, columns: int, rows: int, square_m: float) -> Target:
        """A grid of dots, `square_m` metres apart; it looks the same after half a turn."""
        return cls("circles", {"columns": int(columns), "rows": int(rows), "square_m": float(square_m)})

    @classmethod
    def asymmetric_circles(cls, columns: int, rows: int, square_m: float) -> Target:
        """Dot (column, row) is at ((2 column + row mod 2) square_m, row square_m), as OpenCV has it."""
        return cls("asymmetric_circles", {"columns": int(columns), "rows": int(rows), "square_m": float(square_m)})

    @classmethod
    def charuco(
        cls, columns: int, rows: int, square_m: float, marker_m: float, dictionary: str, layout: Optional[str] = None
    ) -> Target:
        """A chessboard with markers, `columns` × `rows` inner corners; OpenCV's ids of ChArUco corners are the numbers of
        the points. `dictionary` as in dataset.toml, such as "5x5_100"."""
        keys: Dict[str, Any] = {"columns": int(columns), "rows": int(rows), "square_m": float(square_m)}
        keys.update(marker_m=float(marker_m), dictionary=dictionary)
        if layout is not None:
            keys["layout"] = layout
        return cls("charuco", keys)

    @classmethod
    def aprilgrid(cls, columns: int, rows: int, tag_m: float, spacing_m: float, family: str = "apriltag_36h11") -> Target:
        """`columns` × `rows` tags with sides of `tag_m` metres and `spacing_m` between them; its points are the lattice of
        tag corners, 2 columns × 2 rows."""
        keys: Dict[str, Any] = {"columns": int(columns), "rows": int(rows), "tag_m": float(tag_m)}
        keys.update(spacing_m=float(spacing_m), first_id=0, family=family)
        return cls("aprilgrid", keys)

    @classmethod
    def apriltag(cls, tag_m: float, id: int = 0, family: str = "apriltag_36h11") -> Target:
        """One tag with a side of `tag_m` metres; its points are its four corners, row by row."""
        return cls("apriltag", {"tag_m": float(tag_m), "id": int(id), "family": family})

    @classmethod
    def from_points(cls, points: Any) -> Target:
        """The target whose points are `points`, (N, 3) in metres, as they are made for OpenCV's calibrateCamera:
        `(column * square, row * square, 0)`, all of them, row by row.

        The points say nothing of what is printed there, and a chessboard is assumed: where columns and rows add up to an
        even number, views that fit the others only when numbered from the other end are renumbered and reported so.
        """
        array = floats("the points of the target", points)
        if array.ndim == 3 and array.shape[1] == 1:
            array = array[:, 0]
        if array.ndim != 2 or array.shape[1] != 3 or len(array) < 9:
            raise InputError(f"the points of the target have shape {array.shape}, and must be (N, 3) with N of 9 or more")
        if not np.isfinite(array).all():
            raise InputError("a point of the target is not finite")
        columns = int(np.argmax(array[:, 1] != array[0, 1])) or len(array)
        rows, square = len(array) // columns, float(array[1, 0] - array[0, 0])
        row, column = np.divmod(np.arange(len(array)), columns)
        expected = np.stack([column * square, row * square, np.zeros(len(array))], axis=1)
        if rows * columns != len(array) or not square > 0 or np.abs(array - expected).max() > 1e-6 * square:
            raise InputError(
                "the points of the target are no grid (column * square, row * square, 0) in rows, beginning at the origin: "
                "use Target.chessboard, Target.circles or another kind, and number the corners as its points are"
            )
        return cls.chessboard(columns, rows, square)


@dataclass(frozen=True)
class Intrinsics:
    """A camera: pixel (0, 0) is the centre of the top-left pixel, lens models and coefficients are OpenCV's."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    model: str = "none"
    """none, brown_conrady (k1 k2 p1 p2 k3), rational (k1 k2 p1 p2 k3 k4 k5 k6) or fisheye (k1 k2 k3 k4)."""
    distortion: Tuple[float, ...] = ()
    sigma: Optional[Tuple[float, float, float, float]] = None
    """Standard deviations of fx, fy, cx, cy in pixels; None where the camera was given or nothing is known of them."""

    @classmethod
    def from_opencv(
        cls, camera_matrix: Any, dist_coeffs: Any, image_size: Tuple[int, int], fisheye: bool = False
    ) -> Intrinsics:
        """Of OpenCV's camera matrix (3, 3), its coefficients (None, or 0, 4, 5 or 8 of them) and (width, height)."""
        matrix = floats("camera_matrix", camera_matrix)
        if matrix.shape != (3, 3):
            raise InputError(f"camera_matrix has shape {matrix.shape}, and must be (3, 3)")
        if matrix[0, 1] != 0 or tuple(matrix[2]) != (0, 0, 1):
            raise InputError("camera_matrix has a skew, or a last row that is not 0 0 1: such a camera is not in the model")
        values = [] if dist_coeffs is None else [float(v) for v in floats("dist_coeffs", dist_coeffs).reshape(-1)]
        models = {4: "fisheye"} if fisheye else {0: "none", 4: "brown_conrady", 5: "brown_conrady", 8: "rational"}
        if len(values) not in models:
            raise InputError(f"{len(values)} dist_coeffs: {', '.join(map(str, models))} are known here")
        if not fisheye and len(values) == 4:
            values.append(0.0)
        width, height = image_size
        return cls(
            int(width), int(height), float(matrix[0, 0]), float(matrix[1, 1]), float(matrix[0, 2]), float(matrix[1, 2]),
            models[4 if fisheye else len(values)], tuple(values),
        )

    @property
    def camera_matrix(self) -> Array:
        """(3, 3), as OpenCV has it."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    @property
    def dist_coeffs(self) -> Array:
        """As OpenCV has them."""
        return np.array(self.distortion)

    def _document(self) -> Dict[str, Any]:
        return {
            "width": self.width, "height": self.height, "fx": self.fx, "fy": self.fy, "cx": self.cx, "cy": self.cy,
            "model": self.model, "distortion": list(self.distortion),
        }

    @classmethod
    def _of(cls, document: Optional[Mapping[str, Any]]) -> Optional[Intrinsics]:
        if document is None:
            return None
        sigma = document.get("sigma") or {}
        sigmas: Any = (sigma.get("fx"), sigma.get("fy"), sigma.get("cx"), sigma.get("cy"))
        return cls(
            width=document["width"],
            height=document["height"],
            fx=document["fx"],
            fy=document["fy"],
            cx=document["cx"],
            cy=document["cy"],
            model=document["model"],
            distortion=tuple(document["distortion"]),
            sigma=None if None in sigmas else sigmas,
        )


@dataclass(frozen=True)
class Finding:
    """Something that was found in the data or in the answer."""

    code: str
    """Machine-readable, such as outlier_view; see docs/reference/diagnosis.md."""
    severity: str
    """problem (the answer is not to be used), warning, advice or info."""
    message: str
    """A sentence or two, with what to do."""
    views: Tuple[str, ...] = ()
    """Names of the views concerned; empty when it concerns all."""
    evidence: Mapping[str, Tuple[Optional[float], str]] = field(default_factory=dict)
    """The numbers behind it: name, value, unit."""

    def __str__(self) -> str:
        return f"{self.severity} [{self.code}] {self.message}"

    @classmethod
    def _of(cls, document: Mapping[str, Any]) -> Finding:
        evidence = {e["name"]: (e["value"], e["unit"]) for e in document["evidence"]}
        return cls(document["code"], document["severity"], document["text"], tuple(document["views"]), evidence)


def findings_of(documents: Sequence[Mapping[str, Any]]) -> List[Finding]:
    """Findings of a document, the most severe first."""
    return [Finding._of(document) for document in documents]
