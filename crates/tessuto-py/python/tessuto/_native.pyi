"""Types of the extension module; documentation is that of the functions of the package."""

from typing import Any, Callable, Optional

import numpy as np
import numpy.typing as npt

from ._errors import Error

_F64 = npt.NDArray[np.float64]
_F32 = npt.NDArray[np.float32]
_U32 = npt.NDArray[np.uint32]
_U8 = npt.NDArray[np.uint8]
_Faces = list[list[int]]
Intrinsics = tuple[float, float, float, float, int, int]
OfSprings = tuple[_F64, _F64, _F64]
_Stepping = tuple[float, float, bool, float, int]
_Sampling = tuple[int, int, float]
_Frames = Optional[tuple[int, int]]

def version() -> str: ...
def main(arguments: list[str]) -> int: ...

class Scene:
    @staticmethod
    def load(folder: str, frames: _Frames) -> Scene: ...
    @staticmethod
    def assemble(
        name: str,
        fps: float,
        intrinsics: Intrinsics,
        crop: Optional[tuple[int, int, int, int]],
        frames: npt.NDArray[Any],
        masks: npt.NDArray[Any],
        vertices: _F64,
        uv: _F64,
        faces: _Faces,
        uv_faces: Optional[_Faces],
        true_vertices: Optional[_F64],
        true_points: Optional[list[_F64]],
        poses: Optional[_F64],
        views: list[tuple[str, Intrinsics, npt.NDArray[Any], npt.NDArray[Any], _F64]],
        planes: list[tuple[_F64, _F64]],
        back: Optional[str],
    ) -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def place(self) -> str: ...
    @property
    def fps(self) -> float: ...
    @property
    def frame_count(self) -> int: ...
    @property
    def first_frame(self) -> int: ...
    @property
    def camera(self) -> Intrinsics: ...
    @property
    def poses(self) -> Optional[_F64]: ...
    @property
    def views(self) -> list[str]: ...
    @property
    def planes(self) -> list[tuple[list[float], float]]: ...
    @property
    def back(self) -> Optional[str]: ...
    @property
    def crop(self) -> tuple[int, int, int, int]: ...
    @property
    def vertices(self) -> _F64: ...
    @property
    def uv(self) -> _F64: ...
    @property
    def faces(self) -> _Faces: ...
    @property
    def uv_faces(self) -> _Faces: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def true_vertices(self) -> Optional[_F64]: ...
    def frame(self, n: int) -> tuple[_F32, _F32]: ...

def reconstruct(
    scene: Scene,
    out: str,
    preset: str,
    settings: list[str],
    seed: Optional[int],
    appearance: bool,
    replace: bool,
    resume: bool,
    checkpoint: Optional[float],
    command: str,
    on_step: Optional[Callable[..., None]],
) -> Optional[Error]: ...
def appearance(
    scene: Scene,
    folder: str,
    true_motion: bool,
    settings: list[str],
    seed: Optional[int],
    command: str,
    on_step: Optional[Callable[..., None]],
) -> float: ...
def check_result(folder: str) -> tuple[float, int]: ...
def read_image(path: str) -> _U8: ...
def read_mesh(path: str) -> tuple[_F64, _F64, _Faces, _Faces]: ...
def evaluate(scene: str, result: str, frames: _Frames, seed: int, warn: Callable[[str], None]) -> str: ...
def evaluate_scene(scene: Scene, result: str, seed: int) -> str: ...
def simulate(
    result: str,
    stretch: Optional[float],
    bend: Optional[float],
    shear: Optional[float],
    forces: float,
    contact: Optional[str],
    out: Optional[str],
    replace: bool,
    command: str,
) -> _F64: ...
def render(
    result: str,
    out: str,
    angles: Optional[tuple[float, float]],
    look: Optional[str],
    environment: Optional[str],
    size: Optional[tuple[int, int]],
    frames: _Frames,
    samples: int,
    replace: bool,
) -> str: ...
def formats() -> list[tuple[str, str]]: ...
def export(result: str, to: list[str], out: Optional[str], without_lost: bool, replace: bool) -> list[str]: ...

class Cloth:
    def __new__(cls, vertices: _F64, faces: _Faces) -> Cloth: ...
    @property
    def masses(self) -> _F64: ...
    @property
    def edges(self) -> _U32: ...
    @property
    def rest_lengths(self) -> _F64: ...
    @property
    def bends(self) -> _U32: ...
    @property
    def shears(self) -> _U32: ...

class ClothStep:
    def vjp(self, grad_x: _F64, grad_v: _F64) -> tuple[_F64, _F64, _F64, OfSprings, _F64]: ...

def cloth_step(
    cloth: Cloth,
    x: _F64,
    v: _F64,
    acceleration: _F64,
    stiffnesses: OfSprings,
    stepping: _Stepping,
    contact: Optional[str],
) -> tuple[_F64, _F64, ClothStep]: ...

class Rollout:
    def vjp(self, grad_motion: _F64) -> tuple[_F64, _F64, list[float], _F64, OfSprings, _F64]: ...

def rollout(
    cloth: Cloth,
    x: _F64,
    v: _F64,
    constant: tuple[float, ...],
    dynamic: _F64,
    parts: int,
    stiffnesses: OfSprings,
    substeps: int,
    stepping: _Stepping,
    contact: Optional[str],
) -> tuple[_F64, Rollout]: ...

class Rasterizer:
    def __new__(cls, vertex_count: int, uv: _F64, faces: _Faces, uv_faces: Optional[_Faces]) -> Rasterizer: ...
    @property
    def triangles(self) -> _U32: ...
    @property
    def vertex_count(self) -> int: ...

class Rendered:
    def vjp(self, grad_rgba: _F32, grad_depth: Optional[_F32]) -> tuple[_F64, _F32, _F64]: ...

def rasterize(
    rasterizer: Rasterizer, intrinsics: Intrinsics, positions: _F64, texture: _F32
) -> tuple[_F32, _F32, Rendered]: ...

class LitPoints:
    def __new__(
        cls, intrinsics: Intrinsics, vertices: _F64, uv: _F64, faces: _Faces, uv_faces: Optional[_Faces]
    ) -> LitPoints: ...
    @property
    def pixels(self) -> _U32: ...
    @property
    def positions(self) -> _F32: ...

def direct_light(
    points: LitPoints, planes: _F32, light: _F32, proposal: _F32, sampling: _Sampling
) -> _F32: ...
def direct_light_vjp(
    points: LitPoints, planes: _F32, light: _F32, proposal: _F32, sampling: _Sampling, grad: _F32
) -> tuple[_F32, _F32]: ...
