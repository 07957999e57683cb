#!/usr/bin/env python3
"""Check a recording (.rrd) with rerun's own programs.

usage: check_recording.py FILE.rrd RESULT

FILE is what `tessuto export RESULT --to rrd` or `tessuto reconstruct … --out RESULT --rerun FILE.rrd` wrote.
Checks that `rerun rrd verify` accepts it, and with rerun's Python API that the positions of every frame are those of
RESULT/motion.npy bit for bit, that the triangles, texture coordinates and texture are those of RESULT, that the
pictures are the video, that the fabric projected by the recorded camera covers it, and that losses are those of
history.csv, if the recording holds them. Needs `pip install "rerun-sdk[catalog]" numpy pillow`. Exit status 0:
all passed.
"""

import csv
import io
import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
from PIL import Image
from rerun.server import Server

failures = []


def report(what, passed, detail=""):
    print(f"{'ok  ' if passed else 'FAIL'} rrd: {what}{'  ' + detail if detail else ''}", flush=True)
    if not passed:
        failures.append(what)


def column(dataset, index, name):
    """Rows where `name` has a value: their index values, and the lists."""
    table = dataset.reader(index=index).select(*([index] if index else []), name).to_arrow_table()
    rows = [
        (k, v) for k, v in zip(table[index].to_pylist() if index else range(len(table)), table[name].to_pylist()) if v
    ]
    return [k for k, _ in rows], [v for _, v in rows]


def check_mesh(dataset, result, first, motion):
    frames, shapes = column(dataset, "frame", "/world/fabric:Mesh3D:vertex_positions")
    order = np.argsort(frames)
    shapes = np.array(shapes, np.float32)[order]
    numbers = np.array(frames)[order]
    report("frame numbers", np.array_equal(numbers, first + np.arange(len(motion))), f"{numbers[0]} to {numbers[-1]}")
    same = shapes.shape[:1] == motion.shape[:1] and np.array_equal(shapes[:, : motion.shape[1]], motion)
    report("vertices of every frame, bit for bit", same, f"{shapes.shape}")
    triangles = np.array(column(dataset, None, "/world/fabric:Mesh3D:triangle_indices")[1][0])
    uvs = np.array(column(dataset, None, "/world/fabric:Mesh3D:vertex_texcoords")[1][0])
    lines = [line.split() for line in (result / "mesh.obj").read_text().splitlines()]
    obj_uvs = np.array([[float(w) for w in line[1:3]] for line in lines if line[:1] == ["vt"]])
    corners = [[[int(i) - 1 for i in word.split("/")[:2]] for word in line[1:]] for line in lines if line[:1] == ["f"]]
    fans = np.array([[face[0], face[k], face[k + 1]] for face in corners for k in range(1, len(face) - 1)])
    # Vertices on seams follow those of the template.
    rest = shapes[0][triangles] - motion[0][fans[..., 0]]
    report("triangles are those of mesh.obj", triangles.shape == fans.shape[:2] and not rest.any(), f"{len(triangles)}")
    error = np.abs(uvs[triangles] - obj_uvs[fans[..., 1]] * [1, -1] - [0, 1]).max()
    report("texture coordinates are those of mesh.obj", error < 1e-6, f"largest error {error:.1e}")
    pixels = np.array(column(dataset, None, "/world/fabric:Mesh3D:albedo_texture_buffer")[1][0][0], np.uint8)
    shape = column(dataset, None, "/world/fabric:Mesh3D:albedo_texture_format")[1][0][0]
    diffuse = result / "material/diffuse.png"
    texture = Image.open(diffuse if diffuse.exists() else result / "texture.png").convert("RGB")
    pixels = pixels.reshape(shape["height"], shape["width"], 3).astype(int)
    # A large one is recorded smaller.
    small = texture.resize(pixels.shape[1::-1], Image.Resampling.BOX)
    error = np.abs(pixels - np.array(small, int)).max()
    report(
        "texture is the result's",
        error <= (small.size != texture.size),
        f"{pixels.shape} of {texture.size}, largest error {error}",
    )


def check_video(dataset, result, first, motion):
    frames, files = column(dataset, "frame", "/world/camera/image:EncodedImage:blob")
    matrix = np.array(column(dataset, None, "/world/camera:Pinhole:image_from_camera")[1][0][0]).reshape(3, 3).T
    size = column(dataset, None, "/world/camera:Pinhole:resolution")[1][0][0]
    worst, outside = 0.0, 0.0
    for frame, file in zip(frames, files):
        picture = Image.open(io.BytesIO(bytes(file[0])))
        observed = Image.open(result / f"pictures/observed/frame_{frame:03}.png").convert("RGB")
        if picture.size != tuple(size):
            return report("pictures have the camera's size", False, f"{picture.size}, expected {size}")
        small = np.array(observed.resize(picture.size, Image.Resampling.BOX), float)
        worst = max(worst, np.abs(np.array(picture, float) - small).mean())
        projected = motion[frame - first] @ matrix.T
        pixel = np.floor(projected[:, :2] / projected[:, 2:]).astype(int)
        inside = np.all((pixel >= 0) & (pixel < size), axis=1)
        lit = small[pixel[inside, 1], pixel[inside, 0]].max(-1) > 8
        outside = max(outside, 1 - lit.mean())
    report(
        "pictures of every frame",
        len(frames) == len(motion) and worst < 4,
        f"{len(frames)}, {size} px, largest mean difference {worst:.1f} of 255",
    )
    report(
        "fabric projected by the camera lies on the video's",
        outside < 0.2,
        f"up to {100 * outside:.0f} % of the vertices beside it",
    )


def check_losses(dataset, result):
    rows = list(csv.DictReader((result / "history.csv").open()))
    names = [c.name for c in dataset.schema().component_columns() if c.name.startswith("/losses/")]
    if not names:
        return report("losses", True, "none, it is no recording of a run")
    compared = 0
    for stage in dict.fromkeys(row["stage"] for row in rows):
        numbers = [n for n, row in enumerate(rows, 1) if row["stage"] == stage]
        for name in (column.removeprefix("loss.") for column in rows[0] if column.startswith("loss.")):
            if f"/losses/{stage}/{name}:Scalars:scalars" not in names:
                continue
            steps, values = column(dataset, "step", f"/losses/{stage}/{name}:Scalars:scalars")
            expected = [float(rows[n - 1]["loss." + name]) for n in numbers]
            same = [v[0] for _, v in sorted(zip(steps, values))] == expected and sorted(steps) == numbers
            compared += same
            if not same:
                report(f"losses/{stage}/{name}", False)
    report("losses of every step are those of history.csv", compared > 0, f"{compared} curves")


path, result = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
motion = np.load(result / "motion.npy")
first = json.loads((result / "config.json").read_text())["frames"][0]
program = Path(sysconfig.get_path("scripts")) / "rerun"
done = subprocess.run([program, "rrd", "verify", path], capture_output=True, text=True)
report("rerun rrd verify", done.returncode == 0, (done.stdout + done.stderr).strip().splitlines()[-1])
with Server(host="127.0.0.1", datasets={"recording": [str(path)]}) as server:
    dataset = server.client().get_dataset("recording")
    check_mesh(dataset, result, first, motion)
    check_video(dataset, result, first, motion)
    check_losses(dataset, result)
print(f"{len(failures)} failures" if failures else "all passed")
sys.exit(bool(failures))
