"""Scenes of folders and of arrays."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tessuto


def test_arrays_make_the_scene_of_their_folder(scene_folder: Path, scene: tessuto.Scene) -> None:
    loaded = tessuto.Scene.load(scene_folder)
    assert (scene.crop, scene.camera, scene.fps) == (loaded.crop, loaded.camera, loaded.fps)
    assert scene.warnings == loaded.warnings
    for n in range(len(loaded)):
        for a, b in zip(scene.frame(n), loaded.frame(n)):
            assert a.dtype == np.float32 and np.array_equal(a, b)
    assert repr(loaded).startswith("<tessuto.Scene 'synthetic cloth 0': 3 frames of ")
    part = tessuto.Scene.load(scene_folder, frames=(0, 2))
    assert len(part) == 2 and len(scene) == 3
    with pytest.raises(ValueError, match="frame 3 of 3"):
        scene.frame(3)


def parts() -> dict[str, Any]:
    """A square of 16×16 px, 1 m away."""
    frames = np.zeros((2, 24, 24, 3), dtype=np.uint8)
    frames[:, 4:20, 4:20] = 200
    masks = np.zeros((2, 24, 24), dtype=bool)
    masks[:, 4:20, 4:20] = True
    x, y = np.meshgrid(np.linspace(-0.2, 0.2, 3), np.linspace(-0.2, 0.2, 3))
    vertices = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3)
    faces = np.array([[k, k + 3, k + 4, k + 1] for k in (0, 1, 3, 4)])
    return {
        "frames": frames,
        "masks": masks,
        "camera": tessuto.Camera(40.0, 40.0, 11.5, 11.5, 24, 24),
        "vertices": vertices,
        "faces": faces,
        "uv": vertices[:, :2] + 0.5,
        "fps": 25.0,
    }


def made(**changes: Any) -> tessuto.Scene:
    return tessuto.Scene(**{**parts(), **changes})


def test_every_kind_of_number_says_the_same() -> None:
    scene = made()
    colour, coverage = scene.frame(0)
    assert coverage.max() == 1.0 and colour.max() == np.float32(200) / np.float32(255)
    floats = made(frames=np.asarray(parts()["frames"]) / 255.0, masks=np.asarray(parts()["masks"], dtype=float))
    assert np.abs(floats.frame(0)[0] - colour).max() < 1e-5
    assert np.array_equal(floats.frame(0)[1], coverage)
    words = made(masks=np.asarray(parts()["masks"], dtype=np.uint16) * np.uint16(65535))
    assert np.array_equal(words.frame(1)[1], coverage)


def test_what_cannot_be_used_is_refused_with_place_cause_and_remedy() -> None:
    everything = parts()
    with pytest.raises(tessuto.InputError) as caught:
        made(masks=np.zeros((2, 24, 24), dtype=bool))
    error = caught.value
    assert (error.place, error.exit_code) == ("masks[0]", 3)
    assert error.cause.startswith("the mask is empty") and error.remedy.endswith("frames=(first, end)")
    assert str(error) == f"{error.place}: {error.cause}\n  hint: {error.remedy}"
    assert isinstance(error, tessuto.Error) and isinstance(error, ValueError)
    behind = np.asarray(everything["vertices"]) * [1, -1, -1]
    with pytest.raises(tessuto.InputError, match=r"OpenGL axes.*vertices\[:, 1\] \*= -1; vertices\[:, 2\] \*= -1"):
        made(vertices=behind)
    refused: list[tuple[dict[str, Any], str]] = [
        ({"frames": np.full((2, 24, 24, 3), 300.0)}, "values from 300 to 300"),
        ({"masks": np.zeros((3, 24, 24), dtype=bool)}, r"masks: has shape \(3, 24, 24\), expected \(2, 24, 24\)"),
        ({"frames": np.zeros((2, 24, 24, 3), dtype=complex)}, "an array of complex128"),
        ({"faces": [[0, 3, 99]]}, r"face 0 is \[0, 3, 99\]"),
        ({"fps": 0.0}, '"fps" is 0'),
        ({"true_vertices": np.ones((1, 9, 3))}, r"truth: has shape \[1, 9\]"),
    ]
    for changes, message in refused:
        with pytest.raises(tessuto.InputError, match=message):
            made(**changes)
    with pytest.raises(ValueError, match="expected"):
        made(vertices=np.ones((9, 2)))
    with pytest.raises(tessuto.InputError, match="is not a folder"):
        tessuto.Scene.load("nowhere")


def test_a_scene_goes_to_another_process() -> None:
    scene = made()
    again = pickle.loads(pickle.dumps(scene))
    assert repr(again) == repr(scene) and np.array_equal(again.frame(1)[0], scene.frame(1)[0])


def test_a_camera_that_moves_has_poses() -> None:
    assert made().poses is None
    poses = np.tile(np.eye(4), (2, 1, 1))
    poses[:, :3, 3] = [[0.5, 0.0, 0.0], [0.47, 0.0, 0.0]]
    scene = made(poses=poses)
    # Relative to the first one: the world is what that camera sees.
    expected = np.tile(np.eye(4), (2, 1, 1))
    expected[1, 0, 3] = -0.03
    assert scene.poses is not None and np.abs(scene.poses - expected).max() < 1e-12
    assert np.array_equal(np.asarray(pickle.loads(pickle.dumps(scene)).poses), scene.poses)
    with pytest.raises(tessuto.InputError, match="poses"):
        made(poses=poses[:1, :3])
    mirrored = poses * np.array([-1.0, 1.0, 1.0, 1.0])[:, None]
    with pytest.raises(tessuto.InputError, match="left-handed"):
        made(poses=mirrored)


def test_further_cameras_are_views() -> None:
    assert made().views == []
    everything = parts()
    images = {key: everything[key] for key in ("frames", "masks", "camera")}
    pose = np.eye(4)
    pose[0, 3] = 0.01
    scene = made(views=[tessuto.View(**images, poses=pose, name="right")])
    assert scene.views == ["right"] and pickle.loads(pickle.dumps(scene)).views == ["right"]
    refused: list[tuple[dict[str, Any], str]] = [
        ({"poses": pose[:3]}, "view right, poses"),
        ({"poses": 2.0 * pose}, "view right, poses, pose 0"),
        ({"frames": everything["frames"][:1], "masks": everything["masks"][:1]}, "view right, frames: 1 of 2"),
        ({"masks": everything["masks"][:1]}, "view right, masks: has shape"),
    ]
    for changes, message in refused:
        with pytest.raises(tessuto.InputError, match=message):
            made(views=[tessuto.View(**{**images, "poses": pose, "name": "right", **changes})])
    aside = pose.copy()
    aside[0, 3] = 5.0
    with pytest.raises(tessuto.InputError, match="view right.*overlap"):
        made(views=[tessuto.View(**images, poses=aside, name="right")])
