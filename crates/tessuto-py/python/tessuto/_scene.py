"""Scenes: of a folder, or of arrays in memory."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _native
from ._arrays import ArrayLike, Faces, Float32, Float64, PathLike, corners, optional_corners, shaped
from ._errors import InputError


@dataclass(frozen=True)
class Camera:
    """Pinhole intrinsics in pixels.

    Attributes:
        fx, fy: Focal lengths.
        cx, cy: Principal point: column and row; the centre of the first pixel is at (0, 0).
        width, height: Size of the image.
    """

    fx: float
    fy: float
    cx: float
    cy: float
    width: int
    height: int

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            if not 0.0 < float(getattr(self, name)) < float("inf"):
                raise InputError(name, f"is {getattr(self, name)}", "give a focal length in pixels, above 0")
        for name in ("cx", "cy"):
            if not abs(float(getattr(self, name))) < float("inf"):
                raise InputError(name, f"is {getattr(self, name)}", "give a place in pixels")
        for name in ("width", "height"):
            if int(getattr(self, name)) < 1:
                raise InputError(name, f"is {getattr(self, name)}", "give the size of the image in pixels")

    def _intrinsics(self) -> _native.Intrinsics:
        return (
            float(self.fx),
            float(self.fy),
            float(self.cx),
            float(self.cy),
            int(self.width),
            int(self.height),
        )

    def project(self, points: ArrayLike) -> Float64:
        """Pixel positions [..., 2] (column, row) of points [..., 3] in metres in front of the camera."""
        p = np.asarray(points, dtype=np.float64)
        u = self.fx * p[..., 0] / p[..., 2] + self.cx
        v = self.fy * p[..., 1] / p[..., 2] + self.cy
        return np.stack([u, v], axis=-1)


def _samples(images: Union[ArrayLike, Sequence[ArrayLike]], what: str) -> npt.NDArray[Any]:
    """Images as the program reads them from files: 8 or 16 bits."""
    array = np.asarray(images)
    if array.dtype in (np.uint8, np.uint16):
        return array
    if array.dtype == np.bool_:
        return array.view(np.uint8) * np.uint8(255)
    if np.issubdtype(array.dtype, np.floating):
        low, high = (float(array.min()), float(array.max())) if array.size else (0.0, 0.0)
        if not (0.0 <= low and high <= 1.0):
            raise InputError(
                what, f"values from {low:g} to {high:g}", "give floats in 0 to 1, or 8 or 16 bits"
            )
        words: npt.NDArray[Any] = np.rint(array * 65535.0).astype(np.uint16)
        return words
    raise InputError(what, f"an array of {array.dtype}", "give 8 or 16 bits, bool, or floats in 0 to 1")


def _images(
    frames: Union[ArrayLike, Sequence[ArrayLike]], masks: Union[ArrayLike, Sequence[ArrayLike]], camera: Camera, of: str
) -> tuple[npt.NDArray[Any], npt.NDArray[Any]]:
    """Frames and masks of a camera, one image per frame; `of` is what messages put before their names."""
    colours, coverages = _samples(frames, of + "frames"), _samples(masks, of + "masks")
    size = (camera.height, camera.width)
    for what, array, shape in (
        ("frames", colours, (len(colours), *size, 3)),
        ("masks", coverages, (len(colours), *size)),
    ):
        if array.shape != shape:
            raise InputError(
                of + what,
                f"has shape {array.shape}, expected {shape}",
                "give one image per frame, all of the camera's size",
            )
    return colours, coverages


@dataclass(frozen=True, eq=False)
class View:
    """What a further camera filmed, at the times of the scene's own frames.

    Attributes:
        frames: Video, [N, h, w, 3], as that of `Scene`.
        masks: Where the fabric is, [N, h, w].
        camera: Of the whole image.
        poses: Where the camera was: camera from world, [4, 4] of one that stood still, or [N, 4, 4]; OpenCV axes, m.
            The world is that of the scene's poses, or the frame of its camera where it has none.
        name: What results call it.
    """

    frames: Union[ArrayLike, Sequence[ArrayLike]]
    masks: Union[ArrayLike, Sequence[ArrayLike]]
    camera: Camera
    poses: ArrayLike
    name: str = "second"

    def _native_view(
        self,
    ) -> tuple[str, _native.Intrinsics, npt.NDArray[Any], npt.NDArray[Any], npt.NDArray[np.float64]]:
        of = f"view {self.name}, "
        colours, coverages = _images(self.frames, self.masks, self.camera, of)
        poses = np.asarray(self.poses, dtype=np.float64)
        poses = shaped(of + "poses", poses[None] if poses.ndim == 2 else poses, "N", 4, 4)
        return self.name, self.camera._intrinsics(), colours, coverages, poses


class Scene:
    """What was filmed, by which camera, of which fabric.

    Made of arrays in memory by this constructor, of a folder by `Scene.load`. It is checked as a folder is: what cannot
    be used raises `InputError`, what is doubtful is in `warnings`. Outside of the masks, frames become black;
    both are cut to the part of the image around the masks.

    Args:
        frames: Video, [N, h, w, 3], sRGB: 8 or 16 bits, or floats in 0 to 1, which are kept to 16 bits.
        masks: Where the fabric is, [N, h, w]: 8 or 16 bits (white is fabric), bool, or floats in 0 to 1.
        camera: Of the whole image, with the size of the frames.
        vertices: The fabric in the first frame, [V, 3] m, camera coordinates.
        faces: Polygons: vertex indices, [F, 3] or [F, 4] or one list per face. Their edges are the threads.
        uv: Texture coordinates, [V, 2], or [U, 2] with `uv_faces`; (0, 0) is the lower left corner.
        uv_faces: For every face the indices of its corners in `uv`, where these differ from `faces`.
        fps: Frames per second.
        name: What results call it; a path if it belongs to one.
        crop: The part to keep, (first column, first row, end column, end row), in place of that around the masks.
        true_vertices: True positions of the vertices, [N, V, 3] m, where they are known: `evaluate` compares with them.
        true_points: Measured points of every frame, N arrays [P, 3] m, where they are known.
        poses: Where the camera was in every frame, if it moved: camera from world, [N, 4, 4], OpenCV axes, m. The world
            of the scene is then the camera's frame in the first frame.
        views: What further cameras filmed at the same times.
        planes: What the fabric lies on and does not pass, such as a table: (a point of it, the direction across it),
            [3] m each, in the world of the scene. `Contact` simulates with such planes.
        back: What the fabric's other side looks like: "same" (dyed through), "plain" (one colour), that colour as
            "#rrggbb", or "other"; None leaves it to the clip.

    Raises:
        InputError: naming the array and frame.
    """

    def __init__(
        self,
        frames: Union[ArrayLike, Sequence[ArrayLike]],
        masks: Union[ArrayLike, Sequence[ArrayLike]],
        camera: Camera,
        vertices: ArrayLike,
        faces: Faces,
        uv: ArrayLike,
        *,
        fps: float,
        uv_faces: Optional[Faces] = None,
        name: str = "fabric",
        crop: Optional[tuple[int, int, int, int]] = None,
        true_vertices: Optional[ArrayLike] = None,
        true_points: Optional[Sequence[ArrayLike]] = None,
        poses: Optional[ArrayLike] = None,
        views: Sequence[View] = (),
        planes: Sequence[tuple[ArrayLike, ArrayLike]] = (),
        back: Optional[str] = None,
    ) -> None:
        colours, coverages = _images(frames, masks, camera, "")
        self._native: _native.Scene = _native.Scene.assemble(
            name,
            float(fps),
            camera._intrinsics(),
            crop,
            colours,
            coverages,
            shaped("vertices", vertices, "V", 3),
            shaped("uv", uv, "U", 2),
            corners(faces),
            optional_corners(uv_faces),
            None if true_vertices is None else shaped("true_vertices", true_vertices, "N", "V", 3),
            None
            if true_points is None
            else [shaped("true_points", points, "P", 3) for points in true_points],
            None if poses is None else shaped("poses", poses, "N", 4, 4),
            [view._native_view() for view in views],
            [(shaped("planes", point, 3), shaped("planes", across, 3)) for point, across in planes],
            back,
        )
        given = (
            frames,
            masks,
            camera,
            vertices,
            faces,
            uv,
            fps,
            uv_faces,
            name,
            crop,
            true_vertices,
            true_points,
            poses,
            tuple(views),
            tuple(planes),
            back,
        )
        self._made: tuple[Any, ...] = (_assembled, given)

    @classmethod
    def load(cls, folder: PathLike, frames: Optional[tuple[int, int]] = None) -> Scene:
        """Read the scene in `folder` (docs/formats.md); of its frames (first, one past the last), all where None.

        Raises:
            InputError: naming the file.
        """
        scene = cls.__new__(cls)
        scene._native = _native.Scene.load(os.fspath(folder), frames)
        scene._made = (cls.load, (folder, frames))
        return scene

    def __reduce__(self) -> tuple[Any, ...]:
        """Made again of what it was made of: the arrays, or the folder, which must still be there."""
        return self._made

    @property
    def name(self) -> str:
        """Its name."""
        return self._native.name

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self._native.fps

    @property
    def first_frame(self) -> int:
        """Number of the first frame."""
        return self._native.first_frame

    @property
    def camera(self) -> Camera:
        """Camera of the crop: what `frame` returns was seen by it."""
        return Camera(*self._native.camera)

    @property
    def poses(self) -> Optional[Float64]:
        """Where the camera was in every frame, camera from world, [N, 4, 4]; None if it stood still."""
        return self._native.poses

    @property
    def planes(self) -> list[tuple[Float64, float]]:
        """Planes that the fabric lies on: the unit vector n across each, [3], and n·x of its points, m."""
        return [(np.array(normal), height) for normal, height in self._native.planes]

    @property
    def back(self) -> Optional[str]:
        """What the fabric's other side looks like, as the scene says it; None where the clip is left to tell."""
        return self._native.back

    @property
    def views(self) -> list[str]:
        """Names of the further cameras."""
        return self._native.views

    @property
    def crop(self) -> tuple[int, int, int, int]:
        """The part of the whole image that is used: first column, first row, end column, end row."""
        return self._native.crop

    @property
    def vertices(self) -> Float64:
        """The fabric in the first frame, [V, 3] m."""
        return self._native.vertices

    @property
    def uv(self) -> Float64:
        """Texture coordinates, [U, 2]."""
        return self._native.uv

    @property
    def faces(self) -> list[list[int]]:
        """Vertex indices of every polygon."""
        return self._native.faces

    @property
    def uv_faces(self) -> list[list[int]]:
        """Indices in `uv` of every polygon."""
        return self._native.uv_faces

    @property
    def warnings(self) -> list[str]:
        """What is doubtful about it."""
        return self._native.warnings

    @property
    def true_vertices(self) -> Optional[Float64]:
        """True positions of the vertices, [N, V, 3] m, where they are known."""
        return self._native.true_vertices

    def frame(self, n: int) -> tuple[Float32, Float32]:
        """Colour [h, w, 3] and coverage [h, w] of frame `n`, counted from 0, in 0 to 1, of the crop."""
        return self._native.frame(n)

    def __len__(self) -> int:
        return self._native.frame_count

    def __repr__(self) -> str:
        x0, y0, x1, y1 = self.crop
        return (
            f"<tessuto.Scene {self.name!r}: {len(self)} frames of {x1 - x0}×{y1 - y0} px at {self.fps:g} per second, "
            f"{len(self.vertices)} vertices>"
        )


def _assembled(*given: Any) -> Scene:
    frames, masks, camera, vertices, faces, uv, fps, uv_faces, name, crop, *rest = given
    true_vertices, true_points, poses, views, planes, back = rest
    return Scene(
        frames,
        masks,
        camera,
        vertices,
        faces,
        uv,
        fps=fps,
        uv_faces=uv_faces,
        name=name,
        crop=crop,
        true_vertices=true_vertices,
        true_points=true_points,
        poses=poses,
        views=views,
        planes=planes,
        back=back,
    )


def scene_of(scene: Union[Scene, PathLike], frames: Optional[tuple[int, int]] = None) -> Scene:
    """`scene`, loaded if it is a folder; `frames` of the folder."""
    if not isinstance(scene, Scene):
        return Scene.load(scene, frames)
    if frames is not None:
        raise InputError("frames", "the scene is loaded already", "give the frames to Scene.load")
    return scene
