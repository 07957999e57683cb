"""The simulation as functions of arrays, each with its adjoint."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple, Optional, Union

import numpy as np

from . import _native
from ._arrays import ArrayLike, Faces, Float64, UInt32, corners, doubles, shaped
from ._contact import Contact, settings_of
from ._errors import InputError, UsageError

#: A stiffness: one number, or one per spring.
Stiffness = Union[float, ArrayLike]


class Cloth:
    """Masses and springs of a mesh that is at rest in the shape of `vertices`.

    Every edge is a stretch spring; every path of two edges is an angle spring: bend where the path is straight at rest
    (within 45°), shear where it is not.

    Args:
        vertices: [V, 3] m.
        faces: Vertex indices of every polygon, [F, 3] or [F, 4] or one list per face.
    """

    def __init__(self, vertices: ArrayLike, faces: Faces) -> None:
        self._made = (shaped("vertices", vertices, "V", 3), corners(faces))
        self._native = _native.Cloth(*self._made)

    def __reduce__(self) -> tuple[type[Cloth], tuple[Float64, list[list[int]]]]:
        return Cloth, self._made

    @property
    def masses(self) -> Float64:
        """Mass of every vertex, [V] kg, at 0.1 kg/m²."""
        return self._native.masses

    @property
    def edges(self) -> UInt32:
        """Vertices of the stretch springs, [E, 2]."""
        return self._native.edges

    @property
    def rest_lengths(self) -> Float64:
        """Length of every edge without load, [E] m."""
        return self._native.rest_lengths

    @property
    def bends(self) -> UInt32:
        """Vertices of the bend springs, [B, 3]: end, middle, end."""
        return self._native.bends

    @property
    def shears(self) -> UInt32:
        """Vertices of the shear springs, [S, 3]: end, middle, end."""
        return self._native.shears

    def __repr__(self) -> str:
        return (
            f"<tessuto.Cloth: {len(self.masses)} vertices, {len(self.edges)} edges, {len(self.bends)} bend and "
            f"{len(self.shears)} shear springs>"
        )


def _of_springs(cloth: Cloth, stretch: Stiffness, bend: Stiffness, shear: Stiffness) -> _native.OfSprings:
    counts = (len(cloth.edges), len(cloth.bends), len(cloth.shears))
    values = (stretch, bend, shear)
    full = [_of_each(name, k, n) for name, k, n in zip(("stretch", "bend", "shear"), values, counts)]
    return full[0], full[1], full[2]


def _of_each(name: str, stiffness: Stiffness, count: int) -> Float64:
    try:
        return np.array(np.broadcast_to(doubles(stiffness).reshape(np.shape(stiffness)), count))
    except (TypeError, ValueError):
        found = f"has shape [{', '.join(map(str, np.shape(stiffness)))}], expected [] or [{count}]"
        raise InputError(name, found, "give one stiffness, or one for every spring") from None


def _summed(gradient: Float64, stiffness: Stiffness) -> Float64:
    """The gradient in the shape that the stiffness was given in."""
    shape = np.shape(stiffness)
    return (
        gradient.reshape(shape)
        if np.prod(shape, dtype=int) == len(gradient) and shape
        else np.full(shape, gradient.sum())
    )


class _Stepping(NamedTuple):
    dt: float
    damping: float
    linearized: bool
    tolerance: float
    newton_limit: int


def _stepping(dt: float, damping: float, integrator: str, tolerance: float, newton_limit: int) -> _Stepping:
    if integrator not in ("implicit_euler", "linearized_euler"):
        raise UsageError("integrator", f"is {integrator!r}", 'give "implicit_euler" or "linearized_euler"')
    linearized = integrator == "linearized_euler"
    return _Stepping(float(dt), float(damping), linearized, float(tolerance), int(newton_limit))


def _kept(*values: Any) -> tuple[Any, ...]:
    """Values that stay what they are, whatever becomes of arrays that were given."""
    return tuple(np.array(value) if isinstance(value, (np.ndarray, Sequence)) else value for value in values)


class StepTape(NamedTuple):
    """What the adjoint of a step needs. Pickled, it is what the step was made of, which is done again."""

    native: _native.ClothStep
    stiffness: tuple[Stiffness, Stiffness, Stiffness]
    made: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return _step_again, self.made


def _step_again(cloth: Cloth, given: tuple[Any, ...], options: dict[str, Any]) -> StepTape:
    return cloth_step(cloth, *given, **options)[2]


class StepGradients(NamedTuple):
    """Gradients of a loss by what goes into a step, in the shapes of these.

    `friction` is by the coefficients: between layers, then of every body; empty without contact.
    """

    x: Float64
    v: Float64
    acceleration: Float64
    stretch: Float64
    bend: Float64
    shear: Float64
    friction: Float64


def cloth_step(
    cloth: Cloth,
    x: ArrayLike,
    v: ArrayLike,
    acceleration: ArrayLike,
    stretch: Stiffness,
    bend: Stiffness,
    shear: Stiffness,
    *,
    dt: float,
    damping: float = 1.0,
    integrator: str = "implicit_euler",
    tolerance: float = 1e-9,
    newton_limit: int = 50,
    contact: Optional[Contact] = None,
) -> tuple[Float64, Float64, StepTape]:
    """One time step of the cloth.

    Args:
        cloth: The cloth.
        x, v: Positions m and velocities m/s before, [V, 3].
        acceleration: External force per mass, [V, 3] m/s².
        stretch, bend, shear: Stiffnesses, N/m, J/rad² and J/rad²: one number each, or one per spring.
        dt: Length of the step, s.
        damping: Factor on the velocity before the step.
        integrator: "implicit_euler", the minimum of the incremental potential, or "linearized_euler", one linear solve.
        tolerance: Newton's method ends when no coordinate moves by more, m.
        newton_limit: Most iterations of Newton's method.
        contact: What the cloth touches, with "implicit_euler"; it passes through everything where None.

    Returns:
        Positions and velocities after the step, [V, 3], and what `cloth_step_vjp` needs.

    Raises:
        NumericalError: naming the vertex that is not finite.
    """
    native = _native.cloth_step(
        cloth._native,
        shaped("x", x, len(cloth.masses), 3),
        shaped("v", v, len(cloth.masses), 3),
        shaped("acceleration", acceleration, len(cloth.masses), 3),
        _of_springs(cloth, stretch, bend, shear),
        _stepping(dt, damping, integrator, tolerance, newton_limit),
        settings_of(contact),
    )
    stiffness = _kept(stretch, bend, shear)
    options: dict[str, Any] = {"dt": dt, "damping": damping, "integrator": integrator}
    options |= {"tolerance": tolerance, "newton_limit": newton_limit, "contact": contact}
    made = (cloth, (*_kept(x, v, acceleration), *stiffness), options)
    return native[0], native[1], StepTape(native[2], (stiffness[0], stiffness[1], stiffness[2]), made)


def cloth_step_vjp(tape: StepTape, grad_x: ArrayLike, grad_v: ArrayLike) -> StepGradients:
    """Adjoint of `cloth_step`: gradients of a loss from those by the positions and velocities after it, [V, 3]."""
    x, v, acceleration, springs, friction = tape.native.vjp(
        shaped("grad_x", grad_x, "V", 3), shaped("grad_v", grad_v, "V", 3)
    )
    stretch, bend, shear = (_summed(g, k) for g, k in zip(springs, tape.stiffness))
    return StepGradients(x, v, acceleration, stretch, bend, shear, friction)


class RolloutTape(NamedTuple):
    """What the adjoint of a rollout needs. Pickled, it is what the rollout was made of, which is done again."""

    native: _native.Rollout
    stiffness: tuple[Stiffness, Stiffness, Stiffness]
    #: Whether `dynamic` was the same for all vertices.
    uniform: bool
    made: tuple[Any, ...]

    def __reduce__(self) -> tuple[Any, ...]:
        return _rollout_again, self.made


def _rollout_again(cloth: Cloth, given: tuple[Any, ...], options: dict[str, Any]) -> RolloutTape:
    return rollout(cloth, *given, **options)[1]


class RolloutGradients(NamedTuple):
    """Gradients of a loss by what goes into a rollout, in the shapes of these.

    `friction` is by the coefficients: between layers, then of every body; empty without contact.
    """

    x: Float64
    v: Float64
    constant: Float64
    dynamic: Float64
    stretch: Float64
    bend: Float64
    shear: Float64
    friction: Float64


def rollout(
    cloth: Cloth,
    x: ArrayLike,
    v: Optional[ArrayLike],
    constant: ArrayLike,
    dynamic: ArrayLike,
    stretch: Stiffness,
    bend: Stiffness,
    shear: Stiffness,
    *,
    dt: float,
    substeps: int = 1,
    parts: int = 1,
    damping: float = 1.0,
    integrator: str = "implicit_euler",
    tolerance: float = 1e-9,
    newton_limit: int = 50,
    contact: Optional[Contact] = None,
) -> tuple[Float64, RolloutTape]:
    """Simulate a clip of N frames.

    The external acceleration is `constant` + `dynamic`.

    Args:
        cloth: The cloth.
        x: Positions in frame 0, [V, 3] m.
        v: Velocities in frame 0, [V, 3] m/s; at rest where None.
        constant: Force per mass that is the same in space and time, [3] m/s², such as gravity (0, 9.81, 0).
        dynamic: The rest of the force per mass, [(N - 1)·parts, V, 3] m/s², or [(N - 1)·parts, 3] where it is the same
            for all vertices; its length says how many frames there are.
        stretch, bend, shear: Stiffnesses, N/m, J/rad² and J/rad²: one number each, or one per spring.
        dt: Length of a sub-step, s: 1/(fps·substeps).
        substeps: Sub-steps per frame.
        parts: Entries of `dynamic` per frame, each held for substeps/parts sub-steps.
        damping: Factor on the velocity before every sub-step.
        integrator, tolerance, newton_limit, contact: See `cloth_step`.

    Returns:
        Positions in every frame, [N, V, 3] m, and what `rollout_vjp` needs.

    Raises:
        NumericalError: naming frame and vertex that are not finite.
    """
    count = len(cloth.masses)
    start = shaped("x", x, count, 3)
    if np.ndim(dynamic) == 2:
        along = shaped("dynamic", dynamic, "(N - 1)·parts", 3)
        everywhere = np.repeat(along[:, None], count, axis=1)
    else:
        everywhere = shaped("dynamic", dynamic, "(N - 1)·parts", count, 3)
    native = _native.rollout(
        cloth._native,
        start,
        np.zeros_like(start) if v is None else shaped("v", v, count, 3),
        tuple(float(c) for c in shaped("constant", constant, 3)),
        everywhere,
        int(parts),
        _of_springs(cloth, stretch, bend, shear),
        int(substeps),
        _stepping(dt, damping, integrator, tolerance, newton_limit),
        settings_of(contact),
    )
    stiffness = _kept(stretch, bend, shear)
    options: dict[str, Any] = {"dt": dt, "substeps": substeps, "parts": parts, "damping": damping}
    options |= {"integrator": integrator, "tolerance": tolerance, "newton_limit": newton_limit, "contact": contact}
    made = (cloth, (*_kept(x, v, constant, dynamic), *stiffness), options)
    return native[0], RolloutTape(
        native[1], (stiffness[0], stiffness[1], stiffness[2]), np.ndim(dynamic) == 2, made
    )


def rollout_vjp(tape: RolloutTape, grad_motion: ArrayLike) -> RolloutGradients:
    """Adjoint of `rollout`: gradients of a loss from those by the positions in every frame, [N, V, 3]."""
    given = shaped("grad_motion", grad_motion, "N", "V", 3)
    x, v, constant, dynamic, springs, friction = tape.native.vjp(given)
    if tape.uniform:
        dynamic = dynamic.sum(axis=1)
    stretch, bend, shear = (_summed(g, k) for g, k in zip(springs, tape.stiffness))
    return RolloutGradients(x, v, np.array(constant), dynamic, stretch, bend, shear, friction)
