"""Find bend stiffness and wind from points that were tracked on a cloth, by PyTorch's optimiser."""

import numpy as np
import torch
from torch import Tensor

import tessuto
import tessuto.torch as tt

# A square cloth of 9×9 vertices, 40 cm wide, 1 m before the camera.
n, frames, substeps = 9, 16, 2
u, v = np.meshgrid(np.linspace(-0.2, 0.2, n), np.linspace(-0.2, 0.2, n))
vertices = np.stack([u, v, np.ones_like(u)], -1).reshape(-1, 3)
k = np.arange(n * n).reshape(n, n)
cloth = tessuto.Cloth(vertices, np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], -1).reshape(-1, 4))
x = torch.tensor(vertices)  # Gusts hit the lower half only.
gusts = torch.sin(torch.linspace(0.0, 3.0, frames - 1))[:, None, None] * (x[:, 1:2] > 0)


def tracks(log_bend: Tensor, wind: Tensor) -> Tensor:
    """Every fifth vertex in every frame, at 30 frames per second."""
    options = {"dt": 1.0 / (30.0 * substeps), "substeps": substeps, "damping": 0.97}
    motion = tt.rollout(cloth, x, None, (0.0, 0.0, 0.0), gusts * wind, 200.0, log_bend.exp(), 1e-4, **options)
    return motion[:, 4::5]


seen = tracks(torch.tensor(np.log(2e-3)), torch.tensor([1.0, 0.5, 3.0]).double())
found = [torch.tensor(np.log(2e-4)), torch.zeros(3, dtype=torch.float64)]
optimiser = torch.optim.LBFGS([value.requires_grad_() for value in found], line_search_fn="strong_wolfe", max_iter=60)


def misfit() -> float:
    optimiser.zero_grad()
    loss = 1e4 * ((tracks(found[0], found[1]) - seen) ** 2).sum()
    loss.backward()
    return float(loss)


optimiser.step(misfit)
print(f"bend {found[0].exp().item():.2e} J/rad², wind {found[1].detach().numpy().round(2)} m/s²")
