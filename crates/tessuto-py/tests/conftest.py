"""A small scene and its result, made once."""

from __future__ import annotations

import subprocess
import sysconfig
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

import tessuto

#: Fast settings: the arithmetic is the same.
SETTINGS = {
    "texture": {"size": 32, "epochs": 20},
    "spacetime": {"iterations": 3, "levels": 2},
    "appearance.steps": 12,
    "appearance.render_samples_per_pixel": 8,
}


def program(*arguments: str, status: int = 0) -> subprocess.CompletedProcess[str]:
    """Run the program that pip put on the path."""
    path = Path(sysconfig.get_path("scripts")) / "tessuto"
    done = subprocess.run([str(path), *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == status, done.stderr
    return done


def options() -> list[str]:
    """`SETTINGS` as options of the program."""
    from tessuto._run import _assignments

    return [part for assignment in _assignments(SETTINGS) for part in ("--set", assignment)]


def images(folder: Path) -> list[npt.NDArray[np.uint8]]:
    return [tessuto.read_image(path) for path in sorted(folder.iterdir())]


@pytest.fixture(scope="session")
def scene_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("scenes") / "cloth"
    program("synth", str(folder), "--frames", "3", "--grid", "7x7", "--size", "64")
    return folder


@pytest.fixture(scope="session")
def scene(scene_folder: Path) -> tessuto.Scene:
    """The same scene, of arrays in memory."""
    import json

    said = json.loads((scene_folder / "scene.json").read_text())
    loaded = tessuto.Scene.load(scene_folder)
    camera = tessuto.Camera(*(said[k] for k in ("fx", "fy", "cx", "cy", "width", "height")))
    return tessuto.Scene(
        np.stack(images(scene_folder / "rgbs")),
        np.stack(images(scene_folder / "masks"))[..., 0],
        camera,
        loaded.vertices,
        np.array(loaded.faces),
        loaded.uv,
        uv_faces=loaded.uv_faces,
        fps=said["fps"],
        name=str(scene_folder),
        true_vertices=np.load(scene_folder / "gt/vertices.npy"),
        true_points=[np.load(path) for path in sorted((scene_folder / "gt/points").iterdir())],
    )


@pytest.fixture(scope="session")
def result(scene: tessuto.Scene, tmp_path_factory: pytest.TempPathFactory) -> tessuto.Result:
    out = tmp_path_factory.mktemp("results") / "memory"
    return tessuto.reconstruct(scene, out, settings=SETTINGS)
