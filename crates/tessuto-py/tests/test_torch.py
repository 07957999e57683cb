"""The blocks in PyTorch, checked by its own gradient check, and the example."""

from __future__ import annotations

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from blocks import CAMERA, STEP, STIFFNESS, drawn, lit, simulated

torch = pytest.importorskip("torch", reason="NOT TESTED: PyTorch is not installed")
# Modules of the package that need it.
import tessuto  # noqa: E402
import tessuto.torch as blocks  # noqa: E402


def leaf(value: Any) -> Any:
    return torch.tensor(np.asarray(value, dtype=np.float64), requires_grad=True)


def test_a_step() -> None:
    cloth, (x, v, _, dynamic) = simulated()
    # In units in which they are about 1.
    given = [leaf(k) for k in (x, v, dynamic[0], np.array(STIFFNESS) * [1e-2, 1e3, 1e3])]

    def step(x: Any, v: Any, acceleration: Any, scaled: Any) -> Any:
        k = scaled * torch.tensor([1e2, 1e-3, 1e-3])
        return blocks.cloth_step(cloth, x, v, acceleration, k[0], k[1], k[2], **STEP)

    assert torch.autograd.gradcheck(step, given, eps=1e-6, atol=1e-5, rtol=1e-4)


def test_a_rollout() -> None:
    cloth, given = simulated(3, 3)
    leaves = [leaf(k) for k in (*given, np.array(STIFFNESS) * [1e-2, 1e3, 1e3])]

    def run(x: Any, v: Any, constant: Any, dynamic: Any, scaled: Any) -> Any:
        k = scaled * torch.tensor([1e2, 1e-3, 1e-3])
        return blocks.rollout(cloth, x, v, constant, dynamic, k[0], k[1], k[2], substeps=2, parts=2, **STEP)

    assert torch.autograd.gradcheck(run, leaves, eps=1e-6, atol=1e-5, rtol=1e-4)
    found = run(*leaves).detach().numpy()
    expected, _ = tessuto.rollout(cloth, *given, *STIFFNESS, substeps=2, parts=2, **STEP)
    assert np.allclose(found, expected, atol=1e-12)


def test_the_rasteriser() -> None:
    rasterizer, positions, texture = drawn()
    weights = torch.tensor(np.random.default_rng(3).standard_normal((20, 20, 4)))

    def loss(positions: Any, texture: Any) -> Any:
        image, depth = blocks.rasterize(rasterizer, CAMERA, positions, texture)
        return (image * weights).sum(), image[8:12, 8:12].sum() + depth[6:14, 6:14].sum()

    # The image is in single precision.
    given = (leaf(positions), leaf(texture[:6, :6]))
    assert torch.autograd.gradcheck(loss, given, eps=1e-5, atol=0.1, rtol=0.02)


def test_direct_light() -> None:
    seen, material, environment = lit()
    options: dict[str, Any] = {"samples": 8, "seed": 1, "proposal": environment}
    rest = torch.tensor(material[3:].astype(np.float64))

    def colours(base: Any, light: Any) -> Any:
        return blocks.direct_light(seen, torch.cat([base, rest]), light, **options)

    given = (leaf(material[:3]), leaf(environment))
    assert torch.autograd.gradcheck(colours, given, eps=1e-2, atol=1e-4, rtol=1e-3)


def test_a_wrong_adjoint_would_be_seen() -> None:
    cloth, given = simulated(3, 3)
    x = leaf(given[0])

    def run(x: Any) -> Any:
        motion = blocks.rollout(cloth, x, None, *given[2:], *STIFFNESS, **STEP)
        return motion + (motion.detach() * 1e-2)

    with pytest.raises(RuntimeError, match="Jacobian mismatch"):
        torch.autograd.gradcheck(run, (x,), eps=1e-6, atol=1e-5, rtol=1e-4)


def test_the_example_finds_stiffness_and_wind(capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(__file__).parents[1] / "examples/fit_bend_and_wind.py"
    assert len(path.read_text().splitlines()) <= 40
    found = runpy.run_path(str(path))
    assert found["found"][0].item() == pytest.approx(np.log(2e-3), abs=0.02)
    assert np.allclose(found["found"][1].detach().numpy(), [1.0, 0.5, 3.0], atol=0.01)
    assert "bend" in capsys.readouterr().out
