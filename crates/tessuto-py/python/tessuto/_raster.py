"""The rasteriser as a function of arrays, with its adjoint."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional

import numpy as np

from . import _native
from ._arrays import ArrayLike, Faces, Float32, Float64, UInt32, corners, optional_corners, shaped, shaped_singles
from ._scene import Camera


class Rasterizer:
    """Everything about a mesh that does not move.

    Args:
        faces: Vertex indices of every polygon, [F, 3] or [F, 4] or one list per face.
        uv: Texture coordinates, [V, 2], or [U, 2] with `uv_faces`; (0, 0) is the lower left corner.
        uv_faces: For every face the indices of its corners in `uv`, where these differ from `faces`.
        vertex_count: V; that of `uv` where None.
    """

    def __init__(
        self,
        faces: Faces,
        uv: ArrayLike,
        uv_faces: Optional[Faces] = None,
        vertex_count: Optional[int] = None,
    ) -> None:
        coordinates = shaped("uv", uv, "U", 2)
        count = len(coordinates) if vertex_count is None else vertex_count
        self._made = (corners(faces), coordinates, optional_corners(uv_faces), count)
        self._native = _native.Rasterizer(count, coordinates, self._made[0], self._made[2])

    def __reduce__(self) -> tuple[Any, ...]:
        return Rasterizer, self._made

    @property
    def triangles(self) -> UInt32:
        """Vertices of the triangles that the polygons are drawn as, [T, 3]."""
        return self._native.triangles


class RasterTape(NamedTuple):
    """What the adjoint of an image needs. Pickled, it is what the image was made of, which is drawn again."""

    native: _native.Rendered
    made: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return _rasterized_again, self.made


def _rasterized_again(*given: Any) -> RasterTape:
    return rasterize(*given)[2]


class RasterGradients(NamedTuple):
    """Gradients of a loss by positions [V, 3], texture [h, w, 3] and texture coordinates [U, 2]."""

    positions: Float64
    texture: Float32
    uv: Float64


def rasterize(
    rasterizer: Rasterizer, camera: Camera, positions: ArrayLike, texture: ArrayLike
) -> tuple[Float32, Float32, RasterTape]:
    """Draw a textured mesh, antialiased, over black.

    Args:
        rasterizer: The mesh.
        camera: Who sees it.
        positions: Vertices, [V, 3] m, camera coordinates.
        texture: [h, w, 3]; row 0 is v = 1; looked up bilinearly.

    Returns:
        Colour and coverage, [height, width, 4]; depth z in m, [height, width], 0 where there is no mesh; and what
        `rasterize_vjp` needs. In single precision; the geometry is computed in double precision.
    """
    places = np.array(shaped("positions", positions, "V", 3))
    texels = np.array(shaped_singles("texture", texture, "h", "w", 3))
    rgba, depth, native = _native.rasterize(rasterizer._native, camera._intrinsics(), places, texels)
    return rgba, depth, RasterTape(native, (rasterizer, camera, places, texels))


def rasterize_vjp(
    tape: RasterTape, grad_rgba: ArrayLike, grad_depth: Optional[ArrayLike] = None
) -> RasterGradients:
    """Adjoint of `rasterize`: gradients of a loss from those by colour and coverage, and by depth.

    Silhouettes move with colour and coverage, not with depth, which is not antialiased.
    """
    depth = None if grad_depth is None else shaped_singles("grad_depth", grad_depth, "height", "width")
    return RasterGradients(*tape.native.vjp(shaped_singles("grad_rgba", grad_rgba, "height", "width", 4), depth))
