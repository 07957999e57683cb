"""What Python costs, in time of the processor: it can be measured beside other work.

    python overhead.py rollout            # as `cargo bench -p tessuto-bench --bench sim -- rollout`, through PyTorch
    python overhead.py scene FOLDER [N]   # a scene from memory against the program, N times each
"""

import hashlib
import json
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import tessuto


def used(who: int = resource.RUSAGE_SELF) -> float:
    """Time of the processor so far [s]."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def timed(work: Callable[[], object], times: int) -> tuple[float, float]:
    """Median time and median time of the processor [s]."""
    taken = []
    for _ in range(times):
        start = (time.perf_counter(), used())
        work()
        taken.append((time.perf_counter() - start[0], used() - start[1]))
    return statistics.median(t[0] for t in taken), statistics.median(t[1] for t in taken)


def rollout() -> None:
    """26×26 vertices, 10 frames of 4 sub-steps, forward and backward: the same numbers as the benchmark in Rust."""
    import torch

    import tessuto.torch

    n, frames, spacing = 26, 10, 0.02
    i = np.arange(n * n)
    flat = np.stack([(i % n - (n - 1) / 2) * spacing, (i // n - (n - 1) / 2) * spacing, np.full(n * n, 1.2)], -1)
    k = i.reshape(n, n)
    faces = np.stack([k[:-1, :-1], k[1:, :-1], k[1:, 1:], k[:-1, 1:]], -1).reshape(-1, 4)
    cloth = tessuto.Cloth(flat, faces)
    x = flat.copy()
    x[:, 2] += 0.002 * np.sin(flat[:, 0] / (3 * spacing))
    j = 3 * i[:, None] + np.arange(3)
    v = 0.05 * np.sin(1.7 * j)
    dynamic = np.stack([3.0 * np.sin(0.9 * j + frame) for frame in range(frames)])
    start, speed, wind = (torch.tensor(a, requires_grad=True) for a in (x, v, dynamic))
    gravity = torch.tensor([0.0, 9.81, 0.0], dtype=torch.float64, requires_grad=True)
    options = {"dt": 5e-3, "substeps": 4, "damping": 0.9, "tolerance": 1e-7}

    def run() -> None:
        motion = tessuto.torch.rollout(cloth, start, speed, gravity, wind, 200.0, 1e-3, 1e-4, **options)
        (0.5 * (motion[1:] ** 2).sum()).backward()

    run()
    wall, cpu = timed(run, 30)
    print(
        f"rollout {n}x{n}, 40 sub-steps, forward and backward through PyTorch: "
        f"{1e3 * wall:.1f} ms, {1e3 * cpu:.1f} ms of the processor"
    )


def in_memory(folder: Path) -> tessuto.Scene:
    said = json.loads((folder / "scene.json").read_text())
    loaded = tessuto.Scene.load(folder)
    points = [np.load(path) for path in sorted((folder / "gt/points").glob("*.npy"))]
    images = {kind: [tessuto.read_image(p) for p in sorted((folder / kind).iterdir())] for kind in ("rgbs", "masks")}
    return tessuto.Scene(
        np.stack(images["rgbs"]),
        np.stack(images["masks"])[..., 0],
        tessuto.Camera(*(said[key] for key in ("fx", "fy", "cx", "cy", "width", "height"))),
        loaded.vertices,
        loaded.faces,
        loaded.uv,
        uv_faces=loaded.uv_faces,
        fps=said["fps"],
        name=str(folder),
        crop=loaded.crop,
        true_vertices=loaded.true_vertices,
        true_points=points or None,
    )


def scene(folder: Path, times: int) -> None:
    """From arrays in memory to a result folder, and from the scene's folder by the program."""
    prepared = in_memory(folder)
    with tempfile.TemporaryDirectory() as home:
        out = Path(home)
        taken: dict[str, list[tuple[float, float]]] = {"program": [], "Python": []}
        for k in range(times):
            start = (time.perf_counter(), used(resource.RUSAGE_CHILDREN))
            command = ["tessuto", "reconstruct", str(folder), "--out", str(out / f"program-{k}")]
            subprocess.run(command, check=True, capture_output=True)
            of_program = (time.perf_counter() - start[0], used(resource.RUSAGE_CHILDREN) - start[1])
            taken["program"].append(of_program)
            start = (time.perf_counter(), used())
            tessuto.reconstruct(prepared, out / f"python-{k}")
            taken["Python"].append((time.perf_counter() - start[0], used() - start[1]))
        for who, values in taken.items():
            each = ", ".join(f"{wall:.1f} s ({cpu:.1f} s of the processor)" for wall, cpu in values)
            print(f"{who}: {each}")
        cpu_of = {who: statistics.median(cpu for _, cpu in values) for who, values in taken.items()}
        print(f"Python / program: {cpu_of['Python'] / cpu_of['program']:.3f} of the processor's time")
        differ = []
        for path in sorted(p for p in (out / "program-0").rglob("*") if p.is_file()):
            name = path.relative_to(out / "program-0")
            other = out / "python-0" / name
            hashes = [hashlib.sha256(p.read_bytes()).digest() if p.is_file() else b"" for p in (path, other)]
            if hashes[0] != hashes[1]:
                differ.append(str(name))
        print(f"files that differ: {', '.join(differ) or 'none'}")


if __name__ == "__main__":
    if sys.argv[1] == "rollout":
        rollout()
    else:
        scene(Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1)
