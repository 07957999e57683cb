"""The blocks and their adjoints, without any other package: central differences."""

from __future__ import annotations

import pickle
from typing import Any, Callable

import numpy as np
import pytest
from blocks import CAMERA, STEP, STIFFNESS, drawn, grid, lit, simulated

import tessuto


def check(
    loss: Callable[[Any], float], at: Any, gradient: Any, step: float, tolerance: float, seed: int = 1
) -> None:
    """Compares `gradient` with central differences of `loss` along random directions."""
    rng = np.random.default_rng(seed)
    point = np.asarray(at, dtype=np.float64)
    assert np.shape(gradient) == point.shape
    for _ in range(3):
        direction = rng.standard_normal(point.shape)
        moved = [loss(point + sign * step * direction) for sign in (1, -1)]
        expected = (moved[0] - moved[1]) / (2 * step)
        found = float(np.sum(np.asarray(gradient, dtype=np.float64) * direction))
        scale = max(abs(expected), float(np.linalg.norm(gradient)))
        assert abs(found - expected) <= tolerance * scale, f"{found} and {expected}"


@pytest.mark.parametrize("integrator", ["implicit_euler", "linearized_euler"])
def test_a_step_and_its_adjoint(integrator: str) -> None:
    cloth, (x, v, _, dynamic) = simulated()
    rng = np.random.default_rng(5)
    weights = rng.standard_normal((2, *x.shape))
    options = {**STEP, "integrator": integrator}
    given = [x, v, dynamic[0], *(np.array(k) for k in STIFFNESS)]
    after_x, after_v, tape = tessuto.cloth_step(cloth, *given, **options)
    assert after_x.shape == x.shape and np.allclose(after_x, x + STEP["dt"] * after_v, atol=1e-9)
    gradients = tessuto.cloth_step_vjp(tape, weights[0], weights[1])
    for k, step in enumerate([1e-8, 1e-6, 1e-3, 1e-2, 1e-6, 1e-6]):

        def loss(value: Any) -> float:
            moved = [value if n == k else g for n, g in enumerate(given)]
            found_x, found_v, _ = tessuto.cloth_step(cloth, *moved, **options)
            return float(np.sum(weights[0] * found_x) + np.sum(weights[1] * found_v))

        check(loss, given[k], gradients[k], step, 1e-5)


def test_a_rollout_and_its_adjoint() -> None:
    cloth, given = simulated()
    options = {**STEP, "substeps": 2, "parts": 2}
    everything = [*given, *(np.array(k) for k in STIFFNESS)]
    motion, tape = tessuto.rollout(cloth, *everything, **options)
    assert motion.shape == (3, 12, 3) and np.array_equal(motion[0], given[0])
    weights = np.random.default_rng(6).standard_normal(motion.shape)
    gradients = tessuto.rollout_vjp(tape, weights)
    for k, step in enumerate([1e-6, 1e-4, 1e-3, 1e-3, 1e-2, 1e-6, 1e-6]):

        def loss(value: Any) -> float:
            moved = [value if n == k else g for n, g in enumerate(everything)]
            return float(np.sum(weights * tessuto.rollout(cloth, *moved, **options)[0]))

        check(loss, everything[k], gradients[k], step, 1e-5)


def sliding(friction: float, entries: int = 4) -> tuple[Any, Any]:
    """A sheet that lies on a table and is pushed along it: its motion, and the tape."""
    vertices, faces, _ = grid(4, 3)
    vertices = np.stack([vertices[:, 0], np.full(len(vertices), -1.5e-3), vertices[:, 1]], axis=-1)
    table = tessuto.Plane((0, 0, 0), (0, -1, 0), friction)
    contact = tessuto.Contact(bodies=(table,), slip=0.05)
    v = np.tile([1.0, 0.0, 0.0], (len(vertices), 1))
    dynamic = np.zeros((entries, 3))
    options = {**STEP, "damping": 1.0, "substeps": 4, "contact": contact}
    return tessuto.rollout(
        tessuto.Cloth(vertices, faces), vertices, v, (0, 9.81, 0), dynamic, *STIFFNESS, **options
    )


def test_friction_is_fitted_through_the_adjoint() -> None:
    truth = 0.37
    goal, _ = sliding(truth)
    assert goal[-1, :, 0].mean() - goal[0, :, 0].mean() < 0.075, "friction has slowed it"

    def loss(friction: float) -> tuple[float, float]:
        motion, tape = sliding(friction)
        gradients = tessuto.rollout_vjp(tape, motion - goal)
        assert gradients.friction.shape == (2,)
        return 0.5 * float(np.sum((motion - goal) ** 2)), float(gradients.friction[1])

    h = 1e-4
    slope, numeric = loss(0.2)[1], (loss(0.2 + h)[0] - loss(0.2 - h)[0]) / (2 * h)
    assert abs(slope / numeric - 1) < 1e-4, (slope, numeric)
    # Newton's method on the slope, by secants.
    at, before = 0.2, 0.25
    for _ in range(8):
        here, there = loss(at)[1], loss(before)[1]
        if here == there:
            break
        at, before = at - here * (at - before) / (here - there), at
    assert abs(at - truth) < 1e-4, at


def test_contact_that_cannot_be_is_refused_by_name() -> None:
    cloth, given = simulated()
    cases: list[tuple[Any, str]] = [
        ("table", "contact"),
        (tessuto.Contact(bodies=("table",)), "bodies"),  # type: ignore[arg-type]
        (tessuto.Contact(bodies=(tessuto.Sphere((0, 0, 1), -1.0),)), "radius"),
        (tessuto.Contact(bodies=(tessuto.Sphere((0, 0, 1), 0.5),)), "within body 0"),
        (tessuto.Contact(friction=-1.0), "friction"),
    ]
    for contact, part in cases:
        with pytest.raises(tessuto.Error, match=part):
            tessuto.rollout(cloth, *given, *STIFFNESS, **STEP, contact=contact)


def test_a_stiffness_per_spring_is_one_for_all_of_them() -> None:
    cloth, given = simulated()
    one, tape = tessuto.rollout(cloth, *given, *STIFFNESS, **STEP)
    each = [np.full(len(s), k) for s, k in zip((cloth.edges, cloth.bends, cloth.shears), STIFFNESS)]
    many, tape_of_each = tessuto.rollout(cloth, *given, *each, **STEP)
    assert np.array_equal(one, many)
    weights = np.ones_like(one) * [1.0, 2.0, 3.0]
    a, b = tessuto.rollout_vjp(tape, weights), tessuto.rollout_vjp(tape_of_each, weights)
    for sum_of, gradients, springs in zip(a[4:], b[4:], each):
        assert sum_of.shape == () and gradients.shape == springs.shape
        assert sum_of == pytest.approx(gradients.sum())
    assert repr(cloth) == "<tessuto.Cloth: 12 vertices, 17 edges, 10 bend and 24 shear springs>"


def test_it_falls_as_it_should() -> None:
    vertices, faces, _ = grid(4, 4)
    cloth = tessuto.Cloth(vertices, faces)
    assert cloth.masses.sum() == pytest.approx(0.1 * 0.2 * 0.2)
    motion, _ = tessuto.rollout(
        cloth, vertices, None, [0, 9.81, 0], np.zeros((5, 16, 3)), *STIFFNESS, dt=0.01
    )
    # Backward Euler in free fall: g h² k (k + 1)/2 after k steps.
    fallen = 9.81 * 0.01**2 * 15
    assert np.allclose(motion[5] - vertices, [0, fallen, 0], atol=1e-9)


def test_the_rasteriser_and_its_adjoint() -> None:
    rasterizer, positions, texture = drawn()
    rgba, depth, tape = tessuto.rasterize(rasterizer, CAMERA, positions, texture)
    assert rgba.shape == (20, 20, 4) and depth.shape == (20, 20) and rgba[..., 3].max() == 1.0
    assert ((depth > 0.9) == (depth > 0)).all()
    weights = np.random.default_rng(2).standard_normal(rgba.shape)
    gradients = tessuto.rasterize_vjp(tape, weights)
    with_depth = tessuto.rasterize_vjp(tape, weights, np.ones((20, 20)))
    assert np.abs(with_depth.positions - gradients.positions).max() > 1e-3

    def of_positions(value: Any) -> float:
        return float(np.sum(weights * tessuto.rasterize(rasterizer, CAMERA, value, texture)[0]))

    def of_texture(value: Any) -> float:
        return float(np.sum(weights * tessuto.rasterize(rasterizer, CAMERA, positions, value)[0]))

    check(of_positions, positions, gradients.positions, 1e-5, 2e-2)
    check(of_texture, texture, gradients.texture, 1e-2, 1e-4)
    assert gradients.uv.shape == (16, 2) and rasterizer.triangles.shape == (18, 3)


def test_direct_light_and_its_adjoint() -> None:
    seen, material, environment = lit()
    options: dict[str, Any] = {"samples": 16, "seed": 3, "proposal": environment}
    colours = tessuto.direct_light(seen, material, environment, **options)
    assert colours.shape == (len(seen.pixels), 3) and seen.positions.shape == colours.shape
    assert len(colours) == 16 and colours.min() > 0.0
    weights = np.random.default_rng(4).standard_normal(colours.shape)
    gradients = tessuto.direct_light_vjp(seen, material, environment, weights, **options)

    def of_light(value: Any) -> float:
        return float(np.sum(weights * tessuto.direct_light(seen, material, value, **options)))

    # The directions do not depend on the base colour where the lobes' probabilities are at their bound.
    def of_colour(value: Any) -> float:
        changed = np.concatenate([value, material[3:]])
        return float(np.sum(weights * tessuto.direct_light(seen, changed, environment, **options)))

    check(of_light, environment, gradients.environment, 1e-2, 1e-4)
    check(of_colour, material[:3], gradients.material[:3], 1e-2, 1e-4)
    assert np.abs(gradients.material[3:]).max() > 0.0
    assert np.array_equal(colours, tessuto.direct_light(seen, material, environment, **options))


def test_what_does_not_go_together_is_refused() -> None:
    cloth, (x, v, constant, dynamic) = simulated()
    vertices, faces, uv = grid(4, 3)
    with pytest.raises(ValueError, match=r"x: has shape \[5, 3\], expected \[12, 3\]"):
        tessuto.rollout(cloth, x[:5], None, constant, dynamic, *STIFFNESS, **STEP)
    with pytest.raises(ValueError, match=r"dynamic: has shape .*, expected .*, 12, 3\]"):
        tessuto.rollout(cloth, x, v, constant, dynamic[:, :3], *STIFFNESS, **STEP)
    with pytest.raises(ValueError, match="stretch is not one finite stiffness"):
        tessuto.rollout(cloth, x, v, constant, dynamic, -1.0, 1e-3, 1e-3, **STEP)
    with pytest.raises(ValueError, match="dt is 0"):
        tessuto.rollout(cloth, x, v, constant, dynamic, *STIFFNESS, dt=0.0)
    with pytest.raises(ValueError, match="integrator: is 'euler'"):
        tessuto.rollout(cloth, x, v, constant, dynamic, *STIFFNESS, dt=0.01, integrator="euler")
    with pytest.raises(tessuto.NumericalError, match="frame 1.*vertex 3.*position .NaN") as caught:
        tessuto.rollout(
            cloth, np.where(np.arange(12)[:, None] == 3, np.nan, x), v, constant, dynamic, *STIFFNESS, **STEP
        )
    assert caught.value.remedy.startswith("check the forces")
    with pytest.raises(ValueError, match=r"grad_motion:? has shape"):
        tessuto.rollout_vjp(tessuto.rollout(cloth, x, v, constant, dynamic, *STIFFNESS, **STEP)[1], x[None])
    with pytest.raises(ValueError, match=r"face 0 is \[0, 1, 99\]"):
        tessuto.Cloth(vertices, [[0, 1, 99]])
    with pytest.raises(ValueError, match="vertex 3 has no mass"):
        tessuto.Cloth(vertices, [[0, 1, 4], [4, 1, 2]])
    rasterizer = tessuto.Rasterizer(faces, uv)
    with pytest.raises(tessuto.InputError, match="is not a camera"):
        tessuto.rasterize(
            rasterizer, tessuto.Camera(1.0, 1.0, 0.0, 0.0, 1 << 20, 8), vertices, np.zeros((2, 2, 3))
        )
    with pytest.raises(tessuto.InputError, match=r"texture: has shape \[2, 2, 4\], expected \[h, w, 3\]"):
        tessuto.rasterize(rasterizer, CAMERA, vertices, np.zeros((2, 2, 4)))
    seen, material, environment = lit()
    with pytest.raises(ValueError, match="material: has shape"):
        tessuto.direct_light(seen, material[:3], environment)
    with pytest.raises(ValueError, match="samples is 0"):
        tessuto.direct_light(seen, material, environment, samples=0)


def test_arguments_that_do_not_fit_are_named() -> None:
    vertices, faces, _ = grid(4, 4)
    refused: list[tuple[Callable[[], Any], str]] = [
        (lambda: tessuto.Cloth(vertices[:, :2], faces), r"vertices: has shape \[16, 2\], expected \[V, 3\]"),
        (lambda: tessuto.Cloth(vertices, [[0, 1, -2]]), "faces: face 0 has the corner -2"),
        (
            lambda: tessuto.Cloth(vertices, np.asarray(faces, dtype=float)),
            "faces: face 0 has the corner .*0.0",
        ),
        (lambda: tessuto.Cloth(vertices, [[0, 1, 99]]), r"face 0 is \[0, 1, 99\]"),
        (lambda: tessuto.Cloth("cloth", faces), "vertices: is no array of numbers"),
        (lambda: tessuto.Camera(-1.0, 1.0, 0.0, 0.0, 8, 8), "fx: is -1.0"),
        (lambda: tessuto.Camera(1.0, 1.0, 0.0, 0.0, 0, 8), "width: is 0"),
    ]
    cloth = tessuto.Cloth(vertices, faces)
    still = np.zeros((5, 16, 3))
    wrongs: list[tuple[dict[str, Any], str]] = [
        ({"constant": [0.0, 9.81]}, r"constant: has shape \[2\], expected \[3\]"),
        ({"dynamic": still[:, :9]}, r"dynamic: has shape \[5, 9, 3\], expected \[\(N - 1\)·parts, 16, 3\]"),
        ({"stretch": np.ones(7)}, r"stretch: has shape \[7\], expected \[\] or \[24\]"),
        ({"integrator": "euler"}, "integrator: is 'euler'"),
        ({"dt": 0.0}, "dt is 0 s"),
    ]
    for wrong, message in wrongs:
        given: dict[str, Any] = {
            "x": vertices,
            "v": None,
            "constant": [0, 9.81, 0],
            "dynamic": still,
            "dt": 0.01,
        }
        given |= dict(zip(("stretch", "bend", "shear"), STIFFNESS)) | wrong
        refused.append((lambda given=given: tessuto.rollout(cloth, **given), message))  # type: ignore[misc]
    for work, message in refused:
        with pytest.raises(tessuto.Error, match=message) as caught:
            work()
        assert caught.value.remedy


def test_a_wind_that_is_the_same_everywhere() -> None:
    cloth, (x, v, constant, dynamic) = simulated()
    along = dynamic[:, 0]
    everywhere = np.repeat(along[:, None], len(x), axis=1)
    one, tape = tessuto.rollout(cloth, x, v, constant, along, *STIFFNESS, **STEP)
    same, tape_of_each = tessuto.rollout(cloth, x, v, constant, everywhere, *STIFFNESS, **STEP)
    assert np.array_equal(one, same)
    weights = np.ones_like(one) * [1.0, 2.0, 3.0]
    gradient = tessuto.rollout_vjp(tape, weights).dynamic
    assert gradient.shape == along.shape
    assert np.allclose(gradient, tessuto.rollout_vjp(tape_of_each, weights).dynamic.sum(axis=1))


def test_a_cloth_goes_to_another_process() -> None:
    cloth, (x, v, constant, dynamic) = simulated()
    again = pickle.loads(pickle.dumps(cloth))
    one, other = (tessuto.rollout(c, x, v, constant, dynamic, *STIFFNESS, **STEP)[0] for c in (cloth, again))
    assert np.array_equal(one, other)


def test_tapes_go_to_another_process() -> None:
    cloth, (x, v, constant, dynamic) = simulated()
    weights = np.random.default_rng(3).standard_normal((len(dynamic) + 1, *x.shape))
    tape = tessuto.rollout(cloth, x, v, constant, dynamic, *STIFFNESS, **STEP)[1]
    expected = tessuto.rollout_vjp(tape, weights)
    of_step = tessuto.cloth_step(cloth, x, v, dynamic[0], *STIFFNESS, **STEP)[2]
    expected_of_step = tessuto.cloth_step_vjp(of_step, weights[0], weights[1])
    # What was given changes; what was made of it does not.
    for array in (x, v, constant, dynamic):
        array += 1.0
    again, step_again = pickle.loads(pickle.dumps((tape, of_step)))
    found: list[Any] = [
        tessuto.rollout_vjp(again, weights),
        tessuto.cloth_step_vjp(step_again, weights[0], weights[1]),
    ]
    wanted: list[Any] = [expected, expected_of_step]
    for before, after in zip(wanted, found):
        assert all(np.array_equal(np.asarray(one), np.asarray(other)) for one, other in zip(before, after))


def test_images_and_points_go_to_another_process() -> None:
    positions, faces, uv = grid(4, 4)
    texture = np.random.default_rng(3).random((8, 8, 3))
    rasterizer = tessuto.Rasterizer(faces, uv)
    rgba, _, tape = tessuto.rasterize(rasterizer, CAMERA, positions, texture)
    expected = tessuto.rasterize_vjp(tape, np.ones_like(rgba))
    seen = tessuto.DirectLight(CAMERA, positions, faces, uv)
    given = (positions.copy(), texture.copy())
    for array in (positions, texture):
        array += 1.0
    moved = pickle.loads(pickle.dumps((rasterizer, tape, seen)))
    assert np.array_equal(tessuto.rasterize(moved[0], CAMERA, *given)[0], rgba)
    for one, other in zip(expected, tessuto.rasterize_vjp(moved[1], np.ones_like(rgba))):
        assert np.array_equal(np.asarray(one), np.asarray(other))
    assert np.array_equal(seen.pixels, moved[2].pixels) and np.array_equal(seen.positions, moved[2].positions)
