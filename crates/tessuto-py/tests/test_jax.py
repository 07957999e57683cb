"""The blocks in JAX, checked by its own gradient check."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from blocks import CAMERA, STEP, STIFFNESS, drawn, lit, simulated

jax = pytest.importorskip("jax", reason="NOT TESTED: JAX is not installed")
jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

import tessuto  # noqa: E402
import tessuto.jax as blocks  # noqa: E402

SCALES = np.array([1e2, 1e-3, 1e-3])


def test_a_step() -> None:
    cloth, (x, v, _, dynamic) = simulated(3, 3)

    def step(x: Any, v: Any, acceleration: Any, scaled: Any) -> Any:
        k = scaled * SCALES
        return blocks.cloth_step(cloth, x, v, acceleration, k[0], k[1], k[2], **STEP)

    given = (x, v, dynamic[0], np.array(STIFFNESS) / SCALES)
    check_grads(step, given, order=1, modes=["rev"], eps=1e-6, atol=1e-5, rtol=1e-4)


def test_a_rollout_also_when_it_is_compiled() -> None:
    cloth, given = simulated(3, 3)

    @jax.jit
    def run(x: Any, v: Any, constant: Any, dynamic: Any, scaled: Any) -> Any:
        k = scaled * SCALES
        return blocks.rollout(cloth, x, v, constant, dynamic, k[0], k[1], k[2], substeps=2, parts=2, **STEP)

    everything = (*given, np.array(STIFFNESS) / SCALES)
    check_grads(run, everything, order=1, modes=["rev"], eps=1e-6, atol=1e-5, rtol=1e-4)
    expected, _ = tessuto.rollout(cloth, *given, *STIFFNESS, substeps=2, parts=2, **STEP)
    assert np.allclose(run(*everything), expected, atol=1e-12)


def test_the_rasteriser() -> None:
    rasterizer, positions, texture = drawn()
    weights = np.random.default_rng(3).standard_normal((20, 20, 4))

    def loss(positions: Any, texture: Any) -> Any:
        image, depth = blocks.rasterize(rasterizer, CAMERA, positions, texture)
        return jnp.sum(image * weights) + jnp.sum(depth[6:14, 6:14])

    check_grads(loss, (positions, texture[:6, :6]), order=1, modes=["rev"], eps=1e-5, atol=0.1, rtol=0.03)


def test_direct_light() -> None:
    seen, material, environment = lit()

    def colours(base: Any, light: Any) -> Any:
        maps = jnp.concatenate([base, material[3:]])
        return blocks.direct_light(seen, maps, light, samples=8, seed=1, proposal=environment)

    check_grads(colours, (material[:3], environment), order=1, modes=["rev"], eps=1e-2, atol=1e-3, rtol=1e-3)
