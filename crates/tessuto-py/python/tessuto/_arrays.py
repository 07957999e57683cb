"""Arrays as the extension module takes them."""

from __future__ import annotations

import operator
import os
from collections.abc import Sequence
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from ._errors import InputError

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


def shaped(what: str, array: ArrayLike, *shape: Union[int, str]) -> Float64:
    """`array` in double precision, contiguous, if it has this shape; a letter stands for any length.

    Raises:
        InputError: naming `what`, the shape found and the shape expected.
    """
    return _checked(what, array, np.float64, shape)


def shaped_singles(what: str, array: ArrayLike, *shape: Union[int, str]) -> Float32:
    """The same in single precision."""
    return _checked(what, array, np.float32, shape)


def _checked(what: str, array: ArrayLike, kind: Any, shape: tuple[Union[int, str], ...]) -> npt.NDArray[Any]:
    expected = f"[{', '.join(str(length) for length in shape)}]"
    try:
        out: npt.NDArray[Any] = np.ascontiguousarray(array, dtype=kind)
    except (TypeError, ValueError) as error:
        raise InputError(what, f"is no array of numbers: {error}", f"give an array {expected}") from None
    known = len(out.shape) == len(shape) and np.ndim(array) == len(shape)
    if not known or any(isinstance(n, int) and n != m for n, m in zip(shape, out.shape)):
        found = f"[{', '.join(str(length) for length in np.shape(array))}]"
        raise InputError(what, f"has shape {found}, expected {expected}", "give one of this shape")
    return out


def corners(faces: Faces, what: str = "faces") -> list[list[int]]:
    """Faces as lists.

    Raises:
        InputError: naming the face with a corner that is no vertex index.
    """
    out: list[list[int]] = []
    try:
        for k, face in enumerate(faces):
            out.append([_corner(corner, what, k) for corner in face])
    except TypeError as error:
        remedy = "give vertex indices, [F, 3] or [F, 4] or one list per face"
        raise InputError(what, f"is no list of faces: {error}", remedy) from None
    return out


def _corner(corner: Any, what: str, face: int) -> int:
    try:
        index = operator.index(corner)
    except TypeError:
        raise InputError(what, f"face {face} has the corner {corner!r}, no whole number", "give integers") from None
    if not 0 <= index < 1 << 32:
        raise InputError(what, f"face {face} has the corner {index}", "give vertex indices, counted from 0")
    return index


def optional_corners(faces: Optional[Faces], what: str = "uv_faces") -> Optional[list[list[int]]]:
    """Faces as lists, if there are any."""
    return None if faces is None else corners(faces, what)
