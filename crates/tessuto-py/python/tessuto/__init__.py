"""Recover a fabric's 3D motion, texture, material and light from one video; simulate, render and differentiate it.

The whole run: `reconstruct` takes a scene, a folder or arrays (`Scene`), to a `Result`; `evaluate`, `appearance`,
`simulate`, `render` and `export` go on from there, and `open` opens an earlier one.

The blocks, each with its adjoint: `cloth_step` and `rollout` simulate, `rasterize` draws, `direct_light` lights. They
are PyTorch functions in `tessuto.torch` and JAX functions in `tessuto.jax`.

Conventions: the world is the OpenCV camera frame (x right, y down, z forward) in metres, seconds and kilograms;
the centre of pixel (column i, row j) is at (i, j); colours are sRGB in 0 to 1 unless they are said to be
linear. N frames, V vertices, h rows, w columns.
"""

from __future__ import annotations

from . import _processor

_processor.check()

from ._cloth import (  # noqa: E402
    Cloth,
    RolloutGradients,
    StepGradients,
    cloth_step,
    cloth_step_vjp,
    rollout,
    rollout_vjp,
)
from ._contact import Contact, Obstacle, Plane, Sphere  # noqa: E402
from ._errors import (  # noqa: E402
    Error,
    InputError,
    InterruptedError,
    NumericalError,
    OutputError,
    ProcessorError,
    SceneWarning,
    UsageError,
)
from ._light import DirectLight, DirectLightGradients, direct_light, direct_light_vjp  # noqa: E402
from ._native import version as _version  # noqa: E402
from ._raster import RasterGradients, Rasterizer, rasterize, rasterize_vjp  # noqa: E402
from ._result import (  # noqa: E402
    FORMATS,
    Constraint,
    Result,
    evaluate,
    export,
    open,
    read_image,
    render,
    simulate,
)
from ._run import Step, appearance, reconstruct  # noqa: E402
from ._scene import Camera, Scene, View  # noqa: E402

__version__: str = _version()

__all__ = [
    "Camera",
    "Cloth",
    "Constraint",
    "Contact",
    "DirectLight",
    "DirectLightGradients",
    "Error",
    "FORMATS",
    "InputError",
    "InterruptedError",
    "NumericalError",
    "Obstacle",
    "OutputError",
    "Plane",
    "ProcessorError",
    "RasterGradients",
    "Rasterizer",
    "Result",
    "RolloutGradients",
    "Scene",
    "SceneWarning",
    "Sphere",
    "Step",
    "StepGradients",
    "UsageError",
    "View",
    "__version__",
    "appearance",
    "cloth_step",
    "cloth_step_vjp",
    "direct_light",
    "direct_light_vjp",
    "evaluate",
    "export",
    "open",
    "rasterize",
    "rasterize_vjp",
    "read_image",
    "reconstruct",
    "render",
    "rollout",
    "rollout_vjp",
    "simulate",
]
