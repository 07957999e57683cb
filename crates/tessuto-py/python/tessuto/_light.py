"""Direct light as a function of arrays, with its adjoint."""

from __future__ import annotations

from typing import Any, NamedTuple, Optional

import numpy as np

from . import _native
from ._arrays import ArrayLike, Faces, Float32, UInt32, corners, optional_corners, shaped, shaped_singles
from ._scene import Camera


class DirectLight:
    """What the pixels of a camera see of a cloth in one pose, and where it shadows itself.

    Args:
        camera: Who sees it.
        positions: Vertices, [V, 3] m, camera coordinates.
        faces: Vertex indices of every polygon.
        uv: Texture coordinates, [V, 2], or [U, 2] with `uv_faces`.
        uv_faces: For every face the indices of its corners in `uv`, where these differ from `faces`.
    """

    def __init__(
        self,
        camera: Camera,
        positions: ArrayLike,
        faces: Faces,
        uv: ArrayLike,
        uv_faces: Optional[Faces] = None,
    ) -> None:
        self.camera = camera
        # Arrays that were given may change; what was made of them does not.
        places, coordinates = (
            np.array(shaped("positions", positions, "V", 3)),
            np.array(shaped("uv", uv, "U", 2)),
        )
        self._made = (camera, places, corners(faces), coordinates, optional_corners(uv_faces))
        self._native = _native.LitPoints(
            camera._intrinsics(), places, coordinates, self._made[2], self._made[4]
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return DirectLight, self._made

    @property
    def pixels(self) -> UInt32:
        """Index row·width + column of the P pixels that see the cloth, [P]."""
        return self._native.pixels

    @property
    def positions(self) -> Float32:
        """What they see, [P, 3] m."""
        return self._native.positions


class DirectLightGradients(NamedTuple):
    """Gradients of a loss by material [5, h, w] and environment [H, W, 3]."""

    material: Float32
    environment: Float32


def direct_light(
    seen: DirectLight,
    material: ArrayLike,
    environment: ArrayLike,
    *,
    samples: int = 64,
    seed: int = 0,
    proposal: Optional[ArrayLike] = None,
    uniform_fraction: float = 0.05,
) -> Float32:
    """Light of an environment that the points send to the camera, estimated by sampling.

    Args:
        seen: The points.
        material: Maps, [5, h, w]: linear base colour red, green, blue, roughness, metallic; row 0 is v = 1.
        environment: Linear radiance from every direction, [H, W, 3]: a lat-long image, its middle where the
            camera looks.
        samples: Directions per point from the light, and as many from the material; rounded up to a multiple of 8.
        seed: Of the directions: the same seed gives the same image.
        proposal: The environment that directions are drawn in proportion to; `environment` where None.
        uniform_fraction: Fraction of them that is drawn uniformly over the sphere.

    Returns:
        Linear colour of every point, [P, 3].
    """
    return _native.direct_light(
        seen._native,
        shaped_singles("material", material, 5, "h", "w"),
        shaped_singles("environment", environment, "H", "W", 3),
        shaped_singles("proposal", environment if proposal is None else proposal, "H", "W", 3),
        (seed, samples, uniform_fraction),
    )


def direct_light_vjp(
    seen: DirectLight,
    material: ArrayLike,
    environment: ArrayLike,
    grad: ArrayLike,
    *,
    samples: int = 64,
    seed: int = 0,
    proposal: Optional[ArrayLike] = None,
    uniform_fraction: float = 0.05,
) -> DirectLightGradients:
    """Adjoint of `direct_light` with the same arguments, from the gradient of a loss by the colours, [P, 3].

    Directions and their densities are constants to it: it is the derivative of the integral, estimated, not that of
    the estimate, whose directions depend on the material and, without `proposal`, on the environment.
    """
    gradients = _native.direct_light_vjp(
        seen._native,
        shaped_singles("material", material, 5, "h", "w"),
        shaped_singles("environment", environment, "H", "W", 3),
        shaped_singles("proposal", environment if proposal is None else proposal, "H", "W", 3),
        (seed, samples, uniform_fraction),
        shaped_singles("grad", grad, "P", 3),
    )
    return DirectLightGradients(*gradients)
