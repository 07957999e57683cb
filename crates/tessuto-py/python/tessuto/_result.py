"""Results: opened, compared, replayed, rendered, exported."""

from __future__ import annotations

import csv
import html
import json
import os
import shutil
import tempfile
import weakref
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple, Optional, Union

import numpy as np
import numpy.typing as npt

from . import _native
from ._arrays import Float32, Float64, PathLike, UInt8
from ._contact import Contact, settings_of
from ._errors import Error, warn
from ._scene import Camera, Scene

FORMATS: dict[str, str] = dict(_native.formats())
"""What `export` can write: the name of each format, and what it holds."""


class Constraint(NamedTuple):
    """What the video says about one parameter.

    Attributes:
        word: "constrained" (the value, within its standard deviation), "at_least" or "at_most" (a bound only),
            "traded_off" (only the combination with another parameter is constrained) or "unconstrained".
        bound: The bound, in the parameter's unit, of "at_least" and "at_most".
        traded_with: The other parameter, of "traded_off".
    """

    word: str
    bound: Optional[float] = None
    traded_with: Optional[str] = None


class Result:
    """What a reconstruction left: a folder (docs/result-folder.md), and its arrays.

    Arrays are read when they are first asked for, mapped from their files without a copy; they cannot be written to.

    Attributes:
        path: The folder.
        failure: What went wrong but cost neither motion nor folder, if anything did.
    """

    def __init__(
        self,
        path: PathLike,
        *,
        failure: Optional[Error] = None,
        home: Optional[Path] = None,
    ) -> None:
        self.path = Path(path)
        self.failure = failure
        if home is not None:
            # A temporary folder vanishes with this object.
            weakref.finalize(self, shutil.rmtree, home, ignore_errors=True)
        self.fps, self._vertex_count = _native.check_result(os.fspath(path))

    def __reduce__(self) -> tuple[Any, ...]:
        """Opened again where it is, which must still be there."""
        return _reopened, (self.path, self.failure)

    def _array(self, name: str) -> Float32:
        array: Float32 = np.load(self.path / name, mmap_mode="r")
        return array

    def _json(self, name: str) -> dict[str, Any]:
        parsed: dict[str, Any] = json.loads((self.path / name).read_text(encoding="utf-8"))
        return parsed

    @cached_property
    def motion(self) -> Float32:
        """Positions of the vertices in every frame, [N, V, 3] m, camera coordinates."""
        return self._array("motion.npy")

    @cached_property
    def forces(self) -> Float32:
        """Dynamic part D of force per mass, [(N - 1)·parts, V, 3] m/s²; the constant part is in `parameters`."""
        return self._array("forces.npy")

    @cached_property
    def deviation(self) -> Optional[Float32]:
        """Standard deviation of every position, [N, V] m; None from preset "saft" and from replays."""
        return self._array("deviation.npy") if (self.path / "deviation.npy").is_file() else None

    @cached_property
    def texture(self) -> UInt8:
        """sRGB colour of the fabric as filmed in the first frame, [h, w, 3]; row 0 is v = 1."""
        return read_image(self.path / "texture.png")

    @cached_property
    def material(self) -> dict[str, UInt8]:
        """Maps "diffuse", "roughness" and "metallic", [h, w, 3] each; empty where they were not estimated."""
        files = sorted((self.path / "material").glob("*.png"))
        return {file.stem: read_image(file) for file in files}

    @cached_property
    def parameters(self) -> dict[str, Any]:
        """parameters.json: stiffnesses and forces with units, and what the video says about them."""
        return self._json("parameters.json")

    @property
    def back(self) -> str:
        """What the other side looks like, as told or found: "same", "plain", "other" or one colour, "#rrggbb"."""
        return str(self.parameters.get("back", "same"))

    @cached_property
    def stiffness(self) -> tuple[float, float, float]:
        """Stretch N/m, bend J/rad² and shear J/rad²: effective values of the replay, no measurements."""
        stretch, bend, shear = (float(self.parameters[k]["value"]) for k in ("stretch", "bend", "shear"))
        return stretch, bend, shear

    @cached_property
    def constraints(self) -> dict[str, Constraint]:
        """What the video says about "stretch", "bend" and "shear" stiffness, "gravity", "drag" and "friction".

        Empty where causes were not searched, and in results of earlier versions.
        """
        found = {**self.parameters, **(self.parameters.get("causes") or {})}
        names = ("stretch", "bend", "shear", "gravity", "drag", "friction")
        said = {name: found.get(name) or {} for name in names}
        return {
            name: Constraint(number["constraint"], number.get("bound"), number.get("with"))
            for name, number in said.items()
            if "constraint" in number
        }

    @cached_property
    def history(self) -> dict[str, npt.NDArray[Any]]:
        """Every step of every stage: columns "stage", "step", "active_frames", "loss.NAME" and "parameter.NAME".

        NaN where a step has no such value.
        """
        with (self.path / "history.csv").open(encoding="utf-8", newline="") as file:
            names, *rows = list(csv.reader(file))
        columns = dict(zip(names, zip(*rows))) if rows else {name: () for name in names}
        types: dict[str, Any] = {"stage": np.str_, "step": np.int64, "active_frames": np.int64}
        return {
            name: np.array(cells, dtype=types[name])
            if name in types
            else np.array([float(cell) if cell else np.nan for cell in cells])
            for name, cells in columns.items()
        }

    @cached_property
    def _mesh(self) -> tuple[Float64, Float64, list[list[int]], list[list[int]]]:
        return _native.read_mesh(os.fspath(self.path / "mesh.obj"))

    @property
    def vertices(self) -> Float64:
        """The template: the fabric in the first frame, [V, 3] m."""
        return self._mesh[0]

    @property
    def uv(self) -> Float64:
        """Texture coordinates, [U, 2]."""
        return self._mesh[1]

    @property
    def faces(self) -> list[list[int]]:
        """Vertex indices of every polygon."""
        return self._mesh[2]

    @property
    def uv_faces(self) -> list[list[int]]:
        """Indices in `uv` of every polygon."""
        return self._mesh[3]

    @cached_property
    def camera(self) -> Camera:
        """Camera of the whole image."""
        return Camera(**self.parameters["camera"])

    @cached_property
    def settings(self) -> dict[str, Any]:
        """All settings of the run."""
        settings: dict[str, Any] = self._json("config.json")["settings"]
        return settings

    @cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json: the verdict in numbers and one sentence."""
        return self._json("summary.json")

    @property
    def verdict(self) -> Optional[str]:
        """State of the worst frame, "found", "doubtful" or "lost"; None where there was no video to compare with."""
        verdict = self.summary.get("verdict")
        return None if verdict is None else str(verdict["state"])

    @property
    def metrics(self) -> dict[str, Any]:
        """metrics.json: every frame's agreement and verdict, errors where there is truth."""
        return self._json("metrics.json") if (self.path / "metrics.json").is_file() else {}

    def __len__(self) -> int:
        return len(self.motion)

    def __repr__(self) -> str:
        stretch, bend, shear = self.stiffness
        first, end = self.summary["frames"]
        verdict = self.summary.get("verdict")
        sentence = "not compared with a video" if verdict is None else verdict["sentence"]
        return (
            f"<tessuto.Result {self.summary['name']!r}: frames {first} to {end - 1} of {self._vertex_count} vertices\n"
            f"  {sentence}\n"
            f"  effective stiffness: stretch {stretch:.3g} N/m, bend {bend:.3g} J/rad², shear {shear:.3g} J/rad²\n"
            f"  {self.path}>"
        )

    def _repr_html_(self) -> str:
        """The report page, with the 3D view."""
        page = self.path / "report.html"
        if not page.is_file():
            return f"<pre>{html.escape(repr(self))}</pre>"
        text = html.escape(page.read_text(encoding="utf-8"), quote=True)
        return f'<iframe title="tessuto report" srcdoc="{text}" style="width: 100%; height: 42em; border: 0"></iframe>'


def _reopened(path: Path, failure: Optional[Error]) -> Result:
    return Result(path, failure=failure)


def open(path: PathLike) -> Result:
    """Open the result in the folder `path`.

    Raises:
        InputError: naming the file that cannot be used.
    """
    return Result(path)


def place_of(result: Union[Result, PathLike]) -> Path:
    """The folder of a result, or the path itself."""
    return result.path if isinstance(result, Result) else Path(result)


def read_image(path: PathLike) -> UInt8:
    """8-bit sRGB colour of a PNG or JPEG file, [h, w, 3]."""
    return _native.read_image(os.fspath(path))


def evaluate(
    scene: Union[Scene, PathLike],
    result: Union[Result, PathLike, npt.NDArray[Any]],
    frames: Optional[tuple[int, int]] = None,
    *,
    seed: int = 0,
) -> dict[str, Any]:
    """Compare a motion with the truth of a scene.

    Args:
        scene: A `Scene` with truth, or a scene's folder with `gt/`.
        result: A result, its folder, a .npy file, or a motion [N, V, 3] m.
        frames: Only these frames of a scene's folder, (first, one past the last).
        seed: Of the surface samples of the Chamfer distance.

    Returns:
        What `tessuto evaluate --json` prints: "mean" over the frames and "frames", with "cd1" (Chamfer
        distance), "p2s1", "depth", "vertex", "track" in m where the truth allows it; "verdicts"; "maps".
    """
    with tempfile.TemporaryDirectory(prefix="tessuto-") as home:
        if isinstance(result, np.ndarray):
            path = Path(home) / "motion.npy"
            np.save(path, np.ascontiguousarray(result, dtype=np.float32))
        else:
            path = place_of(result)
        if isinstance(scene, Scene):
            text = _native.evaluate_scene(scene._native, os.fspath(path), seed)
        else:
            text = _native.evaluate(os.fspath(scene), os.fspath(path), frames, seed, warn)
    evaluation: dict[str, Any] = json.loads(text)
    return evaluation


def simulate(
    result: Union[Result, PathLike],
    *,
    stretch: Optional[float] = None,
    bend: Optional[float] = None,
    shear: Optional[float] = None,
    forces: float = 1.0,
    contact: Optional[Contact] = None,
    out: Optional[PathLike] = None,
    replace: bool = False,
) -> Float64:
    """Replay a motion from its parameters and forces alone, or with changed ones.

    Where causes were searched gravity, air and held vertices act as found. Otherwise (preset "motion") there is
    no gravity and no pin in
    the model: the forces hold the cloth where the video shows it.

    Args:
        result: A result.
        stretch, bend, shear: Other stiffnesses, N/m, J/rad² and J/rad².
        forces: Factor on the dynamic forces; where causes were searched not with other stiffnesses.
        contact: What the cloth touches; nothing where None. It must not pass through any of it in the first frame.
        out: Result folder to write, which `open`, `render` and `export` take.
        replace: Replace an earlier result at `out` that nobody changed since.

    Returns:
        Positions of the vertices in every frame, [N, V, 3] m.
    """
    folder = os.fspath(place_of(result))
    changes = {"stretch": stretch, "bend": bend, "shear": shear}
    shown = [repr(folder), *(f"{key}={value!r}" for key, value in changes.items() if value is not None)]
    if forces != 1.0:
        shown.append(f"forces={forces!r}")
    if contact is not None:
        shown.append(f"contact={contact!r}")
    command = f"tessuto.simulate({', '.join(shown)})"
    target = None if out is None else os.fspath(out)
    return _native.simulate(folder, stretch, bend, shear, float(forces), settings_of(contact), target, replace, command)


def render(
    result: Union[Result, PathLike],
    out: Optional[PathLike] = None,
    *,
    camera: Union[str, tuple[float, float]] = (45.0, 0.0),
    look: Optional[str] = None,
    environment: Optional[PathLike] = None,
    size: Optional[tuple[int, int]] = None,
    frames: Optional[tuple[int, int]] = None,
    samples: int = 64,
    replace: bool = False,
) -> UInt8:
    """Render a recovered fabric from another viewpoint, under another light, plain or as depth.

    Args:
        result: A result.
        out: Folder for the images, frame_000.png and so on.
        camera: "original", or degrees (left, up) around the centre of the fabric.
        look: "material", "texture", "shaded" or "depth"; the material where it was estimated, else the texture.
        environment: Environment map in place of the recovered one: a lat-long image, .exr or .hdr.
        size: Width and height in px in place of the video's.
        frames: (first, one past the last), counted from the result's first.
        samples: Light samples per pixel, rounded up to a multiple of 8.
        replace: Replace earlier views at `out` that nobody changed since.

    Returns:
        sRGB images, [N, h, w, 3].
    """
    if isinstance(camera, str) and camera != "original":
        raise ValueError(f'camera is {camera!r}, it must be "original" or (left, up) in degrees')
    angles = None if isinstance(camera, str) else (float(camera[0]), float(camera[1]))
    with tempfile.TemporaryDirectory(prefix="tessuto-") as home:
        folder = _native.render(
            os.fspath(place_of(result)),
            os.fspath(out) if out is not None else os.path.join(home, "views"),
            angles,
            look,
            None if environment is None else os.fspath(environment),
            size,
            frames,
            samples,
            replace,
        )
        return np.stack([read_image(file) for file in sorted(Path(folder).glob("frame_*.png"))])


def export(
    result: Union[Result, PathLike],
    to: Union[str, Sequence[str]] = "glb",
    out: Optional[PathLike] = None,
    *,
    without_lost: bool = False,
    replace: bool = False,
) -> list[Path]:
    """Write a result for other programs.

    Args:
        result: A result.
        to: One of the keys of `tessuto.FORMATS`, or several, such as ["glb", "npz"].
        out: Folder to write to; `export` in the result's where None.
        without_lost: Leave out the frames whose verdict is "lost".
        replace: Replace earlier exports.

    Returns:
        The files.
    """
    formats = [to] if isinstance(to, str) else list(to)
    target = None if out is None else os.fspath(out)
    files = _native.export(os.fspath(place_of(result)), formats, target, without_lost, replace)
    return [Path(file) for file in files]
