"""The blocks as functions of PyTorch, with gradients.

Arrays are handed over without copies where they are on the CPU and contiguous; others come back to their
device. Gradients of the gradients are not available.
"""

from __future__ import annotations

from typing import Any, Optional

try:
    import torch
    from torch import Tensor
    from torch.autograd.function import once_differentiable
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"{error}: pip install tessuto[torch]", name=error.name) from None

from . import _cloth, _light, _raster
from ._arrays import ArrayLike
from ._cloth import Cloth
from ._light import DirectLight
from ._raster import Rasterizer
from ._scene import Camera

__all__ = ["cloth_step", "direct_light", "rasterize", "rollout"]


def _numbers(tensor: Tensor) -> Any:
    return tensor.detach().cpu().numpy()


def _back(array: Any, like: Tensor) -> Tensor:
    return torch.as_tensor(array).to(dtype=like.dtype, device=like.device)


def _tensor(value: Any, like: Tensor) -> Tensor:
    return (
        value if isinstance(value, Tensor) else torch.as_tensor(value, dtype=like.dtype, device=like.device)
    )


class _ClothStep(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, options: dict[str, Any], cloth: Cloth, *given: Tensor) -> tuple[Tensor, Tensor]:
        x, v, ctx.tape = _cloth.cloth_step(cloth, *(_numbers(t) for t in given), **options)
        ctx.save_for_backward(*given)
        return _back(x, given[0]), _back(v, given[0])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_x: Tensor, grad_v: Tensor) -> tuple[Any, ...]:
        gradients = _cloth.cloth_step_vjp(ctx.tape, _numbers(grad_x), _numbers(grad_v))
        return (None, None, *(_back(g, t) for g, t in zip(gradients, ctx.saved_tensors)))


def cloth_step(
    cloth: Cloth,
    x: Tensor,
    v: Tensor,
    acceleration: Tensor,
    stretch: Any,
    bend: Any,
    shear: Any,
    **options: Any,
) -> tuple[Tensor, Tensor]:
    """`tessuto.cloth_step`, differentiable by all of its arrays: positions and velocities after the step, [V, 3]."""
    stiffness = (_tensor(k, x) for k in (stretch, bend, shear))
    after: tuple[Tensor, Tensor] = _ClothStep.apply(options, cloth, x, v, acceleration, *stiffness)
    return after


class _Rollout(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, options: dict[str, Any], cloth: Cloth, *given: Tensor) -> Tensor:
        motion, ctx.tape = _cloth.rollout(cloth, *(_numbers(t) for t in given), **options)
        ctx.save_for_backward(*given)
        return _back(motion, given[0])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_motion: Tensor) -> tuple[Any, ...]:
        gradients = _cloth.rollout_vjp(ctx.tape, _numbers(grad_motion))
        return (None, None, *(_back(g, t) for g, t in zip(gradients, ctx.saved_tensors)))


def rollout(
    cloth: Cloth,
    x: Tensor,
    v: Optional[Tensor],
    constant: Any,
    dynamic: Tensor,
    stretch: Any,
    bend: Any,
    shear: Any,
    **options: Any,
) -> Tensor:
    """`tessuto.rollout`, differentiable by all of its arrays: positions in every frame, [N, V, 3] m."""
    velocity = torch.zeros_like(x) if v is None else v
    rest = (_tensor(k, x) for k in (constant, dynamic, stretch, bend, shear))
    motion: Tensor = _Rollout.apply(options, cloth, x, velocity, *rest)
    return motion


class _Rasterize(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, mesh: tuple[Rasterizer, Camera], *given: Tensor) -> tuple[Tensor, Tensor]:
        rgba, depth, ctx.tape = _raster.rasterize(*mesh, *(_numbers(t) for t in given))
        ctx.save_for_backward(*given)
        return _back(rgba, given[1]), _back(depth, given[0])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_rgba: Tensor, grad_depth: Tensor) -> tuple[Any, ...]:
        gradients = _raster.rasterize_vjp(ctx.tape, _numbers(grad_rgba), _numbers(grad_depth))
        return (None, *(_back(g, t) for g, t in zip(gradients[:2], ctx.saved_tensors)))


def rasterize(
    rasterizer: Rasterizer, camera: Camera, positions: Tensor, texture: Tensor
) -> tuple[Tensor, Tensor]:
    """`tessuto.rasterize`, differentiable by positions and texture: image [height, width, 4] and depth [height,
    width]."""
    image: tuple[Tensor, Tensor] = _Rasterize.apply((rasterizer, camera), positions, texture)
    return image


class _DirectLight(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, options: dict[str, Any], seen: DirectLight, *given: Tensor) -> Tensor:
        ctx.call = (options, seen)
        ctx.save_for_backward(*given)
        return _back(_light.direct_light(seen, *(_numbers(t) for t in given), **options), given[0])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad: Tensor) -> tuple[Any, ...]:
        options, seen = ctx.call
        material, environment = (_numbers(t) for t in ctx.saved_tensors)
        gradients = _light.direct_light_vjp(seen, material, environment, _numbers(grad), **options)
        return (None, None, *(_back(g, t) for g, t in zip(gradients, ctx.saved_tensors)))


def direct_light(
    seen: DirectLight,
    material: Tensor,
    environment: Tensor,
    *,
    proposal: Optional[ArrayLike] = None,
    **options: Any,
) -> Tensor:
    """`tessuto.direct_light`, differentiable by material and environment: linear colours [P, 3].

    Directions are constants to the derivative, see `tessuto.direct_light_vjp`.
    """
    fixed = _numbers(proposal) if isinstance(proposal, Tensor) else proposal
    colours: Tensor = _DirectLight.apply({"proposal": fixed, **options}, seen, material, environment)
    return colours
