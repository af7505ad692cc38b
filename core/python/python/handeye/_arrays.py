"""Arrays in, arrays out: shapes are checked here, numbers by the estimator."""

from __future__ import annotations

from typing import Any, List, Mapping, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from ._errors import InputError

Array = NDArray[Any]
Corners = Tuple[Optional[bytes], bytes]


def floats(what: str, value: Any) -> Array:
    """`value` as an array of doubles."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} is not an array of numbers: {error}") from error
    return array


def poses(what: str, value: Any) -> Array:
    """A stack of transforms, (N, 4, 4)."""
    if isinstance(value, (list, tuple)):
        for index, one in enumerate(value):
            if np.shape(one) != (4, 4):
                raise InputError(f"{what}[{index}] has shape {np.shape(one)}, and a transform is 4 × 4")
    array = floats(what, value)
    if array.ndim != 3 or array.shape[1:] != (4, 4):
        raise InputError(f"{what} has shape {array.shape}, and poses are (N, 4, 4): a 4 × 4 matrix for each view")
    return array


def joints_of_views(value: Any) -> Array:
    """Joint values of every view, (N, n)."""
    array = floats("joints", value)
    if array.ndim != 2:
        raise InputError(f"joints have shape {array.shape}, and are (N, n): the values of n joints for each view, radians")
    return array


def packed(array: Array) -> bytes:
    """Its bytes as the compiled part takes them."""
    return np.ascontiguousarray(array).tobytes()


def matrices(data: bytes) -> Array:
    """(N, 4, 4) of bytes; read-only."""
    return np.frombuffer(data, dtype=np.float64).reshape(-1, 4, 4)


def corners_of_views(corners: Sequence[Any], ids: Optional[Sequence[Any]]) -> List[Optional[Corners]]:
    """Corners of each view as the compiled part takes them; `None` where the target was not found."""
    if ids is not None and len(ids) != len(corners):
        raise InputError(f"corner_ids of {len(ids)} views for corners of {len(corners)}: one for each view is needed")
    out: List[Optional[Corners]] = []
    for index, points in enumerate(corners):
        if points is None:
            out.append(None)
            continue
        pixels = floats(f"corners[{index}]", points)
        # OpenCV's detectors answer (N, 1, 2).
        if pixels.ndim == 3 and pixels.shape[1] == 1:
            pixels = pixels[:, 0]
        if pixels.ndim != 2 or pixels.shape[1] != 2:
            raise InputError(f"corners[{index}] has shape {pixels.shape}, and corners are (N, 2): u, v in pixels")
        numbers = None
        if ids is not None and ids[index] is not None:
            given = np.asarray(ids[index])
            if given.size and not np.issubdtype(given.dtype, np.integer):
                raise InputError(f"corner_ids[{index}] are {given.dtype}, and must be whole numbers")
            numbers = packed(given.reshape(-1).astype(np.int64))
        out.append((numbers, packed(pixels)))
    return out


def transform(link: Mapping[str, Any]) -> Array:
    """4 × 4 of a link in a result document."""
    x, y, z, w = link["rotation_xyzw"]
    out = np.eye(4)
    out[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    out[:3, 3] = link["translation_m"]
    return out


def covariance(link: Mapping[str, Any]) -> Optional[Array]:
    """6 × 6 of a link in a result document."""
    return None if link["covariance"] is None else np.array(link["covariance"])
