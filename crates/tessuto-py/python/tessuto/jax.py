"""The blocks as functions of JAX, with gradients; they work under `jax.jit`.

They run on the CPU, outside of XLA. Their adjoints compute the block again, because nothing but arrays can be kept for
them. Without `jax.config.update("jax_enable_x64", True)` what goes in and out is rounded to single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, Optional

try:
    import jax
    import jax.numpy as jnp
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"{error}: pip install tessuto[jax]", name=error.name) from None
import numpy as np

from . import _cloth, _light, _raster
from ._arrays import ArrayLike
from ._cloth import Cloth
from ._light import DirectLight
from ._raster import Rasterizer
from ._scene import Camera

__all__ = ["cloth_step", "direct_light", "rasterize", "rollout"]


class _Call:
    """A block with everything that is not differentiated: its values, and its gradients from those of the values.

    Each returns arrays; how many, and of which shapes, is said by `shapes`.
    """

    def values(self, *given: Any) -> Sequence[Any]:
        raise NotImplementedError

    def gradients(self, given: Sequence[Any], of_values: Sequence[Any]) -> Sequence[Any]:
        raise NotImplementedError

    def shapes(self, *given: Any) -> list[tuple[int, ...]]:
        raise NotImplementedError


def _outside(function: Any, shapes: list[Any], *arguments: Any) -> Any:
    """Calls `function` of NumPy arrays from within a computation."""

    def numbers(*arrays: Any) -> tuple[Any, ...]:
        results = function(*(np.asarray(array) for array in arrays))
        return tuple(np.asarray(r, dtype=s.dtype).reshape(s.shape) for r, s in zip(results, shapes))

    return jax.pure_callback(numbers, tuple(shapes), *arguments)


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def _block(call: _Call, *given: Any) -> tuple[Any, ...]:
    like = given[0].dtype
    shapes = [jax.ShapeDtypeStruct(shape, like) for shape in call.shapes(*given)]
    values: tuple[Any, ...] = _outside(call.values, shapes, *given)
    return values


def _forward(call: _Call, *given: Any) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    return _block(call, *given), given


def _backward(call: _Call, given: tuple[Any, ...], of_values: tuple[Any, ...]) -> tuple[Any, ...]:
    shapes = [jax.ShapeDtypeStruct(g.shape, g.dtype) for g in given]
    count = len(given)

    def gradients(*arrays: Any) -> Sequence[Any]:
        return call.gradients(arrays[:count], arrays[count:])

    of_given: tuple[Any, ...] = _outside(gradients, shapes, *given, *of_values)
    return of_given


_block.defvjp(_forward, _backward)


class _ClothStep(_Call):
    def __init__(self, cloth: Cloth, options: dict[str, Any]) -> None:
        self.cloth, self.options = cloth, options

    def values(self, *given: Any) -> Sequence[Any]:
        return _cloth.cloth_step(self.cloth, *given, **self.options)[:2]

    def gradients(self, given: Sequence[Any], of_values: Sequence[Any]) -> Sequence[Any]:
        x, v, acceleration, stretch, bend, shear = given
        tape = _cloth.cloth_step(self.cloth, x, v, acceleration, stretch, bend, shear, **self.options)[2]
        return _cloth.cloth_step_vjp(tape, of_values[0], of_values[1])[: len(given)]

    def shapes(self, *given: Any) -> list[tuple[int, ...]]:
        return [given[0].shape, given[0].shape]


def _arrays(*values: Any) -> list[Any]:
    return [jnp.asarray(value, dtype=jnp.result_type(float)) for value in values]


def cloth_step(
    cloth: Cloth, x: Any, v: Any, acceleration: Any, stretch: Any, bend: Any, shear: Any, **options: Any
) -> tuple[Any, Any]:
    """`tessuto.cloth_step`, differentiable by all of its arrays: positions and velocities after the step, [V, 3]."""
    after = _block(_ClothStep(cloth, options), *_arrays(x, v, acceleration, stretch, bend, shear))
    return after[0], after[1]


class _Rollout(_Call):
    def __init__(self, cloth: Cloth, options: dict[str, Any]) -> None:
        self.cloth, self.options = cloth, options

    def _run(self, given: Sequence[Any]) -> Any:
        x, v, constant, dynamic, stretch, bend, shear = given
        return _cloth.rollout(self.cloth, x, v, constant, dynamic, stretch, bend, shear, **self.options)

    def values(self, *given: Any) -> Sequence[Any]:
        return [self._run(given)[0]]

    def gradients(self, given: Sequence[Any], of_values: Sequence[Any]) -> Sequence[Any]:
        return _cloth.rollout_vjp(self._run(given)[1], of_values[0])[: len(given)]

    def shapes(self, *given: Any) -> list[tuple[int, ...]]:
        frames = given[3].shape[0] // int(self.options.get("parts", 1)) + 1
        return [(frames, *given[0].shape)]


def rollout(
    cloth: Cloth,
    x: Any,
    v: Optional[Any],
    constant: Any,
    dynamic: Any,
    stretch: Any,
    bend: Any,
    shear: Any,
    **options: Any,
) -> Any:
    """`tessuto.rollout`, differentiable by all of its arrays: positions in every frame, [N, V, 3] m."""
    velocity = jnp.zeros_like(jnp.asarray(x)) if v is None else v
    given = _arrays(x, velocity, constant, dynamic, stretch, bend, shear)
    return _block(_Rollout(cloth, options), *given)[0]


class _Rasterize(_Call):
    def __init__(self, rasterizer: Rasterizer, camera: Camera) -> None:
        self.rasterizer, self.camera = rasterizer, camera

    def values(self, *given: Any) -> Sequence[Any]:
        return _raster.rasterize(self.rasterizer, self.camera, given[0], given[1])[:2]

    def gradients(self, given: Sequence[Any], of_values: Sequence[Any]) -> Sequence[Any]:
        tape = _raster.rasterize(self.rasterizer, self.camera, given[0], given[1])[2]
        return _raster.rasterize_vjp(tape, of_values[0], of_values[1])[:2]

    def shapes(self, *given: Any) -> list[tuple[int, ...]]:
        size = (self.camera.height, self.camera.width)
        return [(*size, 4), size]


def rasterize(rasterizer: Rasterizer, camera: Camera, positions: Any, texture: Any) -> tuple[Any, Any]:
    """`tessuto.rasterize`, differentiable by positions and texture: image [height, width, 4] and depth [height,
    width]."""
    image = _block(_Rasterize(rasterizer, camera), *_arrays(positions, texture))
    return image[0], image[1]


class _DirectLight(_Call):
    def __init__(self, seen: DirectLight, options: dict[str, Any]) -> None:
        self.seen, self.options = seen, options

    def values(self, *given: Any) -> Sequence[Any]:
        return [_light.direct_light(self.seen, given[0], given[1], **self.options)]

    def gradients(self, given: Sequence[Any], of_values: Sequence[Any]) -> Sequence[Any]:
        return _light.direct_light_vjp(self.seen, given[0], given[1], of_values[0], **self.options)

    def shapes(self, *given: Any) -> list[tuple[int, ...]]:
        return [(len(self.seen.pixels), 3)]


def direct_light(
    seen: DirectLight,
    material: Any,
    environment: Any,
    *,
    proposal: Optional[ArrayLike] = None,
    **options: Any,
) -> Any:
    """`tessuto.direct_light`, differentiable by material and environment: linear colours [P, 3].

    Directions are constants to the derivative, see `tessuto.direct_light_vjp`.
    """
    fixed = None if proposal is None else np.asarray(proposal)
    call = _DirectLight(seen, {"proposal": fixed, **options})
    return _block(call, *_arrays(material, environment))[0]
