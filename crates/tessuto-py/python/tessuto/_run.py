"""The whole run."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Callable, Optional, Union

from . import _native
from ._arrays import PathLike
from ._errors import warn
from ._result import Result, place_of
from ._scene import Scene, scene_of


@dataclass(frozen=True)
class Step:
    """A finished step of a run, as `on_step` receives it.

    Attributes:
        stage: What is being done, such as "refine".
        step: Steps finished in this stage.
        of: Steps the stage takes.
        progress: Part of the whole run that is done, about, in 0 to 1.
        losses: Losses by name, where the step has any.
        parameters: Parameters by name, where the step has any.
    """

    stage: str
    step: int
    of: int
    progress: float
    losses: dict[str, float]
    parameters: dict[str, float]


OnStep = Callable[[Step], object]


def _assignments(settings: Optional[Mapping[str, Any]], prefix: str = "") -> list[str]:
    """`key=value` of every setting; mappings within go on with a dotted key."""
    out: list[str] = []
    for key, value in (settings or {}).items():
        if isinstance(value, Mapping):
            out += _assignments(value, f"{prefix}{key}.")
        else:
            text = value if isinstance(value, str) else json.dumps(value)
            out.append(f"{prefix}{key}={text}")
    return out


def _call(function: str, *arguments: Any, **options: Any) -> str:
    """A call in Python that repeats what was done, for the log of the result."""
    shown = [repr(os.fspath(a)) if isinstance(a, os.PathLike) else repr(a) for a in arguments]
    shown += [f"{key}={value!r}" for key, value in options.items() if value]
    return f"tessuto.{function}({', '.join(shown)})"


class _Bar:
    """Progress by tqdm."""

    def __init__(self) -> None:
        try:
            from tqdm.auto import tqdm
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(f"{error}: pip install tessuto[progress]", name=error.name) from None

        self.bar = tqdm(total=1.0, bar_format="{l_bar}{bar}| {elapsed}<{remaining} {desc}")
        self.done = 0.0

    def __call__(self, step: Step) -> None:
        self.bar.set_description_str(f"{step.stage} {step.step}/{step.of}", refresh=False)
        if step.progress > self.done:
            self.bar.update(step.progress - self.done)
            self.done = step.progress

    def close(self) -> None:
        self.bar.close()


def _heard(on_step: Optional[OnStep], bar: Optional[_Bar]) -> Optional[Callable[..., None]]:
    listeners = [listener for listener in (on_step, bar) if listener is not None]
    if not listeners:
        return None

    def tell(*values: Any) -> None:
        step = Step(*values)
        for listener in listeners:
            listener(step)

    return tell


def reconstruct(
    scene: Union[Scene, PathLike],
    out: Optional[PathLike] = None,
    preset: str = "default",
    settings: Optional[Mapping[str, Any]] = None,
    on_step: Optional[OnStep] = None,
    *,
    frames: Optional[tuple[int, int]] = None,
    seed: Optional[int] = None,
    appearance: bool = True,
    replace: bool = False,
    resume: bool = False,
    checkpoint: Optional[float] = 30.0,
    progress: bool = False,
) -> Result:
    """Recover the motion of a fabric, with texture, effective forces and stiffnesses, material and light.

    The result is what the program writes, byte for byte; it does not depend on the number of threads
    (RAYON_NUM_THREADS). Python's lock is free meanwhile; Ctrl-C ends the run after the step at hand, with
    checkpoints where there is `out`.

    Args:
        scene: A `Scene`, or a scene's folder.
        out: Result folder to write. Without it the result is in a temporary folder, which lives as long as the
            `Result`.
        preset: Settings to start from: "default", "motion", the same shapes without what moved them, "saft",
            the published method, "phi-sft", after φ-SfT, or "pg-sft", after PG-SfT.
        settings: Changes of single settings (docs/settings.md): {"spacetime.resolution": 200}, or nested.
        on_step: Is called with a `Step` after every step; an exception that it raises ends the run.
        frames: Of a folder, (first, one past the last); the template belongs to the first.
        seed: Of all random numbers.
        appearance: Estimate material and light as well.
        replace: Replace an earlier result at `out` that nobody changed since.
        resume: Go on from the checkpoints of an interrupted run with the same arguments.
        checkpoint: Least time between checkpoints in s, which lie beside `out` meanwhile; None for none.
        progress: Show progress by tqdm.

    Returns:
        The result. If something went wrong that cost neither motion nor folder, it is in `failure`, and a warning.

    Raises:
        InputError: for a scene or folder that cannot be used.
        UsageError: for settings.
        NumericalError: if not even a first state is finite.
        KeyboardInterrupt: at Ctrl-C.
    """
    loaded = scene_of(scene, frames)
    home = None
    if out is None:
        home = Path(tempfile.mkdtemp(prefix="tessuto-"))
        folder, checkpoint = home / "result", None
    else:
        folder = Path(out)
    named = loaded.name if isinstance(scene, Scene) else os.fspath(scene)
    given = None if out is None else os.fspath(out)
    changed = dict(settings) if settings else None
    whole = {"preset": preset, "settings": changed, "frames": frames, "seed": seed}
    command = _call("reconstruct", named, given, **whole)
    if not appearance:
        command = command[:-1] + ", appearance=False)"
    bar = _Bar() if progress else None
    try:
        failure = _native.reconstruct(
            loaded._native,
            os.fspath(folder),
            preset,
            _assignments(settings),
            seed,
            appearance,
            replace,
            resume,
            checkpoint,
            command,
            _heard(on_step, bar),
        )
    except BaseException:
        if home is not None:
            shutil.rmtree(home, ignore_errors=True)
        raise
    finally:
        if bar is not None:
            bar.close()
    if failure is not None:
        warn(str(failure))
    return Result(folder, failure=failure, home=home)


def appearance(
    scene: Union[Scene, PathLike],
    result: Union[Result, PathLike],
    motion: str = "result",
    settings: Optional[Mapping[str, Any]] = None,
    on_step: Optional[OnStep] = None,
    *,
    seed: Optional[int] = None,
    progress: bool = False,
) -> float:
    """Estimate material maps and environment map of a motion that is known, and render its frames again.

    Writes `material/` and `rerendered/` into the result's folder, and its page anew.

    Args:
        scene: A `Scene` of the result's frames, or a scene's folder.
        result: A result; with motion="truth", any folder.
        motion: "result", or "truth": the scene's true vertices.
        settings: Changes of settings of `appearance`, such as {"appearance.steps": 2000}.
        on_step: Is called with a `Step` after every step.
        seed: Of all random numbers, in place of the result's.
        progress: Show progress by tqdm.

    Returns:
        Mean PSNR of the re-rendered frames in dB.
    """
    folder = place_of(result)
    frames = None
    if not isinstance(scene, Scene) and (folder / "config.json").is_file():
        first, end = json.loads((folder / "config.json").read_text(encoding="utf-8"))["frames"]
        frames = (int(first), int(end))
    loaded = scene_of(scene, frames)
    named = loaded.name if isinstance(scene, Scene) else os.fspath(scene)
    bar = _Bar() if progress else None
    if motion not in ("result", "truth"):
        raise ValueError(f'motion is {motion!r}, it must be "result" or "truth"')
    try:
        return _native.appearance(
            loaded._native,
            os.fspath(folder),
            motion == "truth",
            _assignments(settings),
            seed,
            _call("appearance", named, os.fspath(folder), settings=settings, seed=seed),
            _heard(on_step, bar),
        )
    finally:
        if bar is not None:
            bar.close()
