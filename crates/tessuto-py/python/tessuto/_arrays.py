"""Arrays as the extension module takes them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]
Float32 = npt.NDArray[np.float32]
UInt32 = npt.NDArray[np.uint32]
UInt8 = npt.NDArray[np.uint8]
ArrayLike = npt.ArrayLike
PathLike = Union[str, "os.PathLike[str]"]
#: Indices of every face's vertices: an array [F, 3] or [F, 4], or one list per face.
Faces = Union[npt.NDArray[Any], Sequence[Sequence[int]]]


def doubles(array: ArrayLike) -> Float64:
    """`array` in double precision, contiguous; itself if it is so already."""
    return np.ascontiguousarray(array, dtype=np.float64)


def singles(array: ArrayLike) -> Float32:
    """`array` in single precision, contiguous; itself if it is so already."""
    return np.ascontiguousarray(array, dtype=np.float32)


def corners(faces: Faces) -> list[list[int]]:
    """Faces as lists."""
    return [[int(corner) for corner in face] for face in faces]


def optional_corners(faces: Optional[Faces]) -> Optional[list[list[int]]]:
    """Faces as lists, if there are any."""
    return None if faces is None else corners(faces)
