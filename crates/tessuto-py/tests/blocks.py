"""Small inputs for the tests of the blocks."""

from __future__ import annotations

from typing import Any

import numpy as np

import tessuto
from tessuto._arrays import Float32, Float64, UInt32


def grid(columns: int, rows: int, size: float = 0.2) -> tuple[Float64, UInt32, Float64]:
    """Vertices of a flat grid 1 m away, its quads, and texture coordinates."""
    u, v = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    vertices = np.stack([(u - 0.5) * size, (v - 0.5) * size, np.ones_like(u)], axis=-1).reshape(-1, 3)
    corners = np.arange(columns * rows, dtype=np.uint32).reshape(rows, columns)
    quads = np.stack([corners[:-1, :-1], corners[1:, :-1], corners[1:, 1:], corners[:-1, 1:]], axis=-1)
    return vertices, quads.reshape(-1, 4), np.stack([u, 1 - v], axis=-1).reshape(-1, 2)


#: Stretch N/m, bend J/rad², shear J/rad².
STIFFNESS: Any = (120.0, 2e-3, 1e-3)
#: Of a step or rollout.
STEP: dict[str, Any] = {"dt": 0.005, "damping": 0.95, "tolerance": 1e-13}


def simulated(columns: int = 4, rows: int = 3, entries: int = 4, seed: int = 0) -> tuple[tessuto.Cloth, Any]:
    """A cloth, and x, v, constant and dynamic acceleration of a rollout."""
    rng = np.random.default_rng(seed)
    vertices, faces, _ = grid(columns, rows)
    x = vertices + 1e-3 * rng.standard_normal(vertices.shape)
    v = 0.1 * rng.standard_normal(vertices.shape)
    constant = np.array([0.3, 9.81, -0.5])
    dynamic = 3.0 * rng.standard_normal((entries, *vertices.shape))
    return tessuto.Cloth(vertices, faces), [x, v, constant, dynamic]


CAMERA = tessuto.Camera(60.0, 60.0, 9.7, 10.1, 20, 20)


def drawn(seed: int = 0) -> tuple[tessuto.Rasterizer, Float64, Float32]:
    """A mesh, its positions, and a smooth texture."""
    rng = np.random.default_rng(seed)
    vertices, faces, uv = grid(4, 4, 0.22)
    positions = vertices + 4e-3 * rng.standard_normal(vertices.shape)
    y, x = np.mgrid[0:48, 0:48] / 48.0
    waves = [0.5 + 0.3 * np.sin(3 * x + 2 * y + k) for k in range(3)]
    return tessuto.Rasterizer(faces, uv), positions, np.stack(waves, axis=-1).astype(np.float32)


def lit(seed: int = 0) -> tuple[tessuto.DirectLight, Float32, Float32]:
    """Points of a slightly bent cloth, a material whose lobes are drawn with constant probabilities, and an
    environment."""
    rng = np.random.default_rng(seed)
    vertices, faces, uv = grid(3, 3)
    vertices[4, 2] -= 0.01
    material = np.full((5, 2, 2), 0.6, dtype=np.float32)
    material[:3] += 0.2 * rng.random((3, 2, 2)).astype(np.float32)
    material[4] = 0.0
    environment = rng.random((4, 8, 3)).astype(np.float32) + 0.2
    camera = tessuto.Camera(20.0, 20.0, 2.0, 2.0, 5, 5)
    return tessuto.DirectLight(camera, vertices, faces, uv), material, environment
