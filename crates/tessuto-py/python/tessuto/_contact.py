"""What a simulated cloth touches: bodies, and itself."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, Optional, Union

from ._arrays import ArrayLike, Faces, corners, shaped
from ._errors import UsageError


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane, such as a table or a floor, that keeps the cloth on one side.

    Args:
        point: A point of it, [3] m.
        normal: Across it, to the side where the cloth is, [3]; of any length.
        friction: Coefficient of friction.
    """

    point: ArrayLike
    normal: ArrayLike
    friction: float = 0.3

    def _shape(self) -> dict[str, Any]:
        point, normal = shaped("point", self.point, 3), shaped("normal", self.normal, 3)
        length = float((normal @ normal) ** 0.5)
        height = float(normal @ point) / length if length > 0 else 0.0
        return {"plane": {"normal": normal.tolist(), "height": height}}


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball.

    Args:
        centre: [3] m.
        radius: m.
        friction: Coefficient of friction.
    """

    centre: ArrayLike
    radius: float
    friction: float = 0.3

    def _shape(self) -> dict[str, Any]:
        return {"sphere": {"centre": shaped("centre", self.centre, 3).tolist(), "radius": float(self.radius)}}


@dataclass(frozen=True, eq=False)
class Obstacle:
    """A mesh that stands still; both of its sides hold.

    Args:
        vertices: [V, 3] m.
        faces: Vertex indices of every polygon, [F, 3] or [F, 4] or one list per face.
        friction: Coefficient of friction.
    """

    vertices: ArrayLike
    faces: Faces
    friction: float = 0.3

    def _shape(self) -> dict[str, Any]:
        polygons = corners(self.faces)
        triangles = [[p[0], p[k], p[k + 1]] for p in polygons for k in range(1, len(p) - 1)]
        return {
            "mesh": {"positions": shaped("vertices", self.vertices, "V", 3).tolist(), "triangles": triangles}
        }


#: What a cloth can lie on.
Body = Union[Plane, Sphere, Obstacle]


@dataclass(frozen=True, eq=False)
class Contact:
    """What touches what, and how: layers of the cloth, and bodies. Nothing passes through anything.

    Args:
        bodies: Planes, spheres and obstacles.
        layers: Whether layers of the cloth touch each other.
        friction: Coefficient of friction between layers.
        thickness: Gap at which elements begin to feel each other, m; a tenth of the shortest edge where None.
        stiffness: How firmly they are kept apart, N/m²: at half of the thickness the pressure is 1.2 times this.
        slip: Speed at which friction has its whole force, m/s; below, it grows smoothly.
    """

    bodies: tuple[Body, ...] = ()
    layers: bool = True
    friction: float = 0.3
    thickness: Optional[float] = None
    stiffness: float = 10.0
    slip: float = 0.01

    def _json(self) -> str:
        bodies = []
        for body in self.bodies:
            if not isinstance(body, (Plane, Sphere, Obstacle)):
                problem = f"holds a {type(body).__name__}"
                raise UsageError("bodies", problem, "give tessuto.Plane, tessuto.Sphere and tessuto.Obstacle")
            bodies.append({"shape": body._shape(), "friction": float(body.friction)})
        return json.dumps(
            {
                "thickness": None if self.thickness is None else float(self.thickness),
                "stiffness": float(self.stiffness),
                "layers": bool(self.layers),
                "friction": float(self.friction),
                "slip": float(self.slip),
                "bodies": bodies,
            }
        )


def settings_of(contact: Optional[Contact]) -> Optional[str]:
    """As the native module reads it."""
    if contact is not None and not isinstance(contact, Contact):
        raise UsageError("contact", f"is a {type(contact).__name__}", "give a tessuto.Contact")
    return None if contact is None else contact._json()
