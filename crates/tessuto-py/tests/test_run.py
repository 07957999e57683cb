"""The whole run, and what is done with its result."""

from __future__ import annotations

import _thread
import json
import pickle
import signal
import subprocess
import sys
import sysconfig
import threading
import time
import warnings
from pathlib import Path

import numpy as np
import pytest
from conftest import SETTINGS, options, program

import tessuto

#: Files that tell when and by whom a run was made.
OF_THE_RUN = {"log.json", "manifest.json", "report.html", "summary.json"}


def contents(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def test_the_result_is_the_programs_byte_for_byte(
    scene_folder: Path, result: tessuto.Result, tmp_path: Path
) -> None:
    program("reconstruct", str(scene_folder), "--out", str(tmp_path / "program"), *options())
    tessuto.reconstruct(scene_folder, tmp_path / "folder", settings=SETTINGS)
    expected = contents(tmp_path / "program")
    assert len(expected) > 30
    for folder in (result.path, tmp_path / "folder"):
        found = contents(folder)
        assert found.keys() == expected.keys()
        wrong = [name for name in expected if name not in OF_THE_RUN and found[name] != expected[name]]
        assert not wrong, folder
    assert json.loads(expected["config.json"])["settings"] == result.settings
    assert program("verify", str(result.path)).stdout.endswith("all as they were written\n")
    log = json.loads((tmp_path / "folder/log.json").read_text())
    assert log["commands"][0].startswith(f"tessuto.reconstruct('{scene_folder}', '{tmp_path / 'folder'}', preset=")


def test_a_result_has_its_arrays(result: tessuto.Result, scene: tessuto.Scene) -> None:
    n, v = 3, 49
    assert result.motion.shape == (n, v, 3) and len(result) == n
    assert isinstance(result.motion, np.memmap) and not result.motion.flags.writeable
    assert result.motion is result.motion
    assert result.forces.shape[1:] == (v, 3) and result.forces.shape[0] % (n - 1) == 0
    assert result.deviation is not None and result.deviation.shape == (n, v)
    assert result.texture.shape == (32, 32, 3) and result.texture.dtype == np.uint8
    assert {"diffuse", "roughness", "metallic"} <= result.material.keys()
    assert np.array_equal(result.vertices, scene.vertices) and result.faces == scene.faces
    assert np.array_equal(result.uv, scene.uv) and result.uv_faces == scene.uv_faces
    assert result.fps == scene.fps and result.camera.width == 64
    assert result.stiffness[0] == result.parameters["stretch"]["value"]
    assert result.back == "same"
    said = result.constraints
    assert set(said) == {"stretch", "bend", "shear", "gravity", "drag", "friction"}
    assert {c.word for c in said.values()} <= {"constrained", "at_least", "at_most", "traded_off", "unconstrained"}
    assert all((c.bound is not None) == c.word.startswith("at_") for c in said.values())
    assert all((c.traded_with is not None) == (c.word == "traded_off") for c in said.values())
    history = result.history
    assert set(history["stage"]) == {"texture", "track", "refine", "fuse"}
    total = history["loss.total"]
    assert len(total) == len(history["step"]) and np.isfinite(total[history["stage"] == "refine"]).all()
    assert result.verdict in ("found", "doubtful", "lost") and result.metrics["verdicts"]
    text = repr(result)
    assert "frames 0 to 2 of 49 vertices" in text and "N/m" in text and str(result.path) in text


def test_a_result_shows_itself_in_a_notebook(result: tessuto.Result) -> None:
    page = result._repr_html_()
    assert page.startswith("<iframe") and "srcdoc=" in page and "THREE" in page
    assert page.count("<iframe") == 1 and '"' not in page.split('srcdoc="')[1].split('" style=')[0]


def test_without_a_folder_the_result_vanishes_with_its_object(scene: tessuto.Scene) -> None:
    heard: list[tessuto.Step] = []
    result = tessuto.reconstruct(scene, settings=SETTINGS, on_step=heard.append, appearance=False)
    path, motion = result.path, np.array(result.motion)
    assert path.is_dir() and not result.material
    del result
    assert not path.exists() and motion.shape == (3, 49, 3)
    assert {step.stage for step in heard} >= {"texture", "track", "refine"}
    fractions = [step.progress for step in heard]
    assert fractions == sorted(fractions) and 0.0 < fractions[0] and fractions[-1] <= 1.0
    last = [step for step in heard if step.stage == "refine"][-1]
    assert "total" in last.losses and last.of >= last.step


def test_a_callback_ends_the_run_and_it_resumes_to_the_same_bytes(
    scene: tessuto.Scene, result: tessuto.Result, tmp_path: Path
) -> None:
    class Enough(Exception):
        pass

    def stop(step: tessuto.Step) -> None:
        if step.stage == "refine":
            raise Enough(step.step)

    out = tmp_path / "out"
    with pytest.raises(Enough):
        tessuto.reconstruct(scene, out, settings=SETTINGS, on_step=stop, checkpoint=0.0)
    assert not out.exists()
    stages: list[str] = []
    resumed = tessuto.reconstruct(
        scene, out, settings=SETTINGS, on_step=lambda step: stages.append(step.stage), resume=True, checkpoint=0.0
    )
    assert "texture" not in stages and "refine" in stages
    assert (resumed.path / "motion.npy").read_bytes() == (result.path / "motion.npy").read_bytes()


def test_ctrl_c_ends_the_run(scene: tessuto.Scene, tmp_path: Path) -> None:
    def press(step: tessuto.Step) -> None:
        _thread.interrupt_main()

    with pytest.raises(KeyboardInterrupt):
        tessuto.reconstruct(scene, tmp_path / "out", settings=SETTINGS, on_step=press)
    assert not (tmp_path / "out").exists()


def test_other_threads_run_meanwhile(scene: tessuto.Scene) -> None:
    ticks = 0
    done = threading.Event()

    def tick() -> None:
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.001)

    other = threading.Thread(target=tick)
    other.start()
    started = time.monotonic()
    tessuto.reconstruct(scene, settings=SETTINGS, appearance=False)
    elapsed = time.monotonic() - started
    done.set()
    other.join()
    assert ticks > 50 * elapsed, f"{ticks} ticks in {elapsed:.1f} s"


def test_what_cannot_be_done_is_refused(scene_folder: Path, result: tessuto.Result, tmp_path: Path) -> None:
    with pytest.raises(tessuto.UsageError, match="did you mean texture.size"):
        tessuto.reconstruct(scene_folder, tmp_path / "a", settings={"texture": {"sise": 3}})
    with pytest.raises(tessuto.UsageError, match="the presets are"):
        tessuto.reconstruct(scene_folder, tmp_path / "a", preset="fast")
    with pytest.raises(tessuto.InputError) as caught:
        tessuto.reconstruct(scene_folder, result.path)
    assert "replace=True" in caught.value.remedy and str(result.path) in caught.value.place
    with pytest.raises(tessuto.InputError, match="config.json"):
        tessuto.open(tmp_path)
    with pytest.raises(tessuto.UsageError, match="give a value above 0"):
        tessuto.simulate(result, bend=-1.0)
    with pytest.raises(tessuto.UsageError, match="the formats are"):
        tessuto.export(result, "fbx", tmp_path / "b")
    with pytest.raises(tessuto.UsageError, match="the looks are"):
        tessuto.render(result, look="nice")
    assert not list(tmp_path.iterdir())


def test_evaluate_says_what_the_program_says(
    scene_folder: Path, scene: tessuto.Scene, result: tessuto.Result
) -> None:
    said = json.loads(program("evaluate", str(scene_folder), str(result.path), "--json").stdout)
    assert tessuto.evaluate(scene_folder, result) == said
    of_arrays = tessuto.evaluate(scene, result)
    assert of_arrays["mean"] == said["mean"] and 0.0 < said["mean"]["vertex"] < 0.05
    motion = np.array(result.motion)
    assert tessuto.evaluate(scene, motion)["mean"] == said["mean"]
    assert tessuto.evaluate(scene, np.load(scene_folder / "gt/vertices.npy"))["mean"]["vertex"] < 1e-6
    with pytest.raises(tessuto.InputError, match="has 2 frames, the scene has 3"):
        tessuto.evaluate(scene, motion[:2])


def test_a_replay_is_the_motion_and_a_changed_one_a_result(result: tessuto.Result, tmp_path: Path) -> None:
    again = tessuto.simulate(result)
    assert again.dtype == np.float64 and np.abs(again - result.motion).max() < 1e-5
    other = tessuto.simulate(result, bend=0.01, out=tmp_path / "other")
    opened = tessuto.open(tmp_path / "other")
    assert np.abs(opened.motion - other).max() < 1e-6 and opened.stiffness[1] == pytest.approx(0.01)
    assert opened.verdict is None and "not compared" in repr(opened)
    assert np.abs(other - again).max() > 1e-5
    assert np.abs(tessuto.simulate(result, forces=1.5) - again).max() > 1e-5
    far = tessuto.Contact((tessuto.Plane((0.0, 10.0, 0.0), (0.0, -1.0, 0.0)),), layers=False)
    assert np.abs(tessuto.simulate(result, contact=far) - again).max() < 0.02
    across = tessuto.Contact((tessuto.Plane(again[0].mean(axis=0), (0.0, -1.0, 0.0)),))
    with pytest.raises(tessuto.Error, match="passes through"):
        tessuto.simulate(result, contact=across)
    with pytest.raises(tessuto.UsageError, match="give a tessuto.Contact"):
        tessuto.simulate(result, contact=3)  # type: ignore[arg-type]
    with pytest.raises(tessuto.UsageError, match="by their causes"):
        tessuto.simulate(result, bend=0.01, forces=1.5)


def test_views_and_exports_are_the_programs(result: tessuto.Result, tmp_path: Path) -> None:
    views = tessuto.render(result, tmp_path / "a", camera=(30.0, 10.0), look="shaded", size=(48, 32))
    assert views.shape == (3, 32, 48, 3) and views.dtype == np.uint8 and views.max() > 50
    arguments = ["--camera", "30,10", "--look", "shaded", "--size", "48x32", "--out", str(tmp_path / "b")]
    program("render", str(result.path), *arguments)
    for n in range(3):
        name = f"frame_{n:03}.png"
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    assert tessuto.render(result, camera="original", look="depth", frames=(1, 2)).shape == (1, 64, 64, 3)
    files = tessuto.export(result, ["npz", "glb"], tmp_path / "c")
    program("export", str(result.path), "--to", "npz,glb", "--out", str(tmp_path / "d"))
    assert files and all(f.read_bytes() == (tmp_path / "d" / f.name).read_bytes() for f in files)


def test_appearance_of_the_true_motion(scene: tessuto.Scene, scene_folder: Path, tmp_path: Path) -> None:
    settings = {"appearance.steps": 12, "appearance.render_samples_per_pixel": 8}
    psnr = tessuto.appearance(scene, tmp_path / "a", motion="truth", settings=settings)
    assert psnr > 10.0
    (tmp_path / "b").mkdir()
    changes = [part for key, value in settings.items() for part in ("--set", f"{key}={value}")]
    program("appearance", str(scene_folder), str(tmp_path / "b"), "--motion", "gt", *changes)
    for name in ("diffuse.png", "environment.exr"):
        files = [tmp_path / folder / "material" / name for folder in "ab"]
        assert files[0].read_bytes() == files[1].read_bytes()
    with pytest.raises(tessuto.InputError, match='motion="truth"'):
        tessuto.appearance(scene_folder, tmp_path / "c")


def test_warnings_of_a_scene_are_pythons(scene_folder: Path, tmp_path: Path) -> None:
    import shutil

    shutil.copytree(scene_folder, tmp_path / "odd")
    said = json.loads((tmp_path / "odd/scene.json").read_text())
    said["fy"] *= 1.3
    (tmp_path / "odd/scene.json").write_text(json.dumps(said))
    loaded = tessuto.Scene.load(tmp_path / "odd")
    assert any("differ by over 20 %" in text for text in loaded.warnings)
    with warnings.catch_warnings():
        # As an error it ends the run.
        warnings.simplefilter("error", tessuto.SceneWarning)
        with pytest.raises(tessuto.SceneWarning, match="intrinsics"):
            tessuto.reconstruct(loaded, tmp_path / "out", settings=SETTINGS)


def test_a_warning_stands_at_the_line_that_asked(scene_folder: Path, tmp_path: Path) -> None:
    import shutil

    from tessuto._errors import warn

    with pytest.warns(tessuto.SceneWarning) as caught:
        warn("odd")
    assert caught[0].filename == __file__
    shutil.copytree(scene_folder, tmp_path / "odd")
    said = json.loads((tmp_path / "odd/scene.json").read_text())
    said["fy"] *= 1.3
    (tmp_path / "odd/scene.json").write_text(json.dumps(said))
    with pytest.warns(tessuto.SceneWarning) as caught:
        tessuto.reconstruct(tmp_path / "odd", tmp_path / "out", settings=SETTINGS, appearance=False)
    assert any("intrinsics" in str(warning.message) for warning in caught)
    assert {warning.filename for warning in caught} == {__file__}


def test_a_result_goes_to_another_process(result: tessuto.Result) -> None:
    again = pickle.loads(pickle.dumps(result))
    assert isinstance(again, tessuto.Result) and again.path == result.path
    assert np.array_equal(again.motion, result.motion)


def test_the_formats_are_those_of_the_program(result: tessuto.Result, tmp_path: Path) -> None:
    told = program("export", "--help").stdout
    assert "glb" in tessuto.FORMATS and all(key in told for key in tessuto.FORMATS)
    files = tessuto.export(result, list(tessuto.FORMATS), tmp_path / "all")
    assert len(files) >= len(tessuto.FORMATS)


def test_the_program_is_on_the_path() -> None:
    assert program("--version").stdout == f"tessuto {tessuto.__version__}\n"
    assert "tessuto reconstruct" in program("reconstruct", "--help").stdout
    assert "is not a folder" in program("check", "nowhere", status=3).stdout
    assert "nonsense" in program("nonsense", status=2).stderr
    module = [sys.executable, "-m", "tessuto._program", "--version"]
    assert subprocess.run(module, capture_output=True, check=True).stdout.startswith(b"tessuto ")


def test_an_old_processor_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from tessuto import _processor

    old = "processor : 0\nflags : fpu sse4_2 avx f16c\n"
    assert _processor.missing(old) == ["avx2", "fma", "bmi1", "bmi2", "movbe", "abm"]
    assert _processor.missing("no flags\n") == []
    monkeypatch.setattr(_processor, "_lacking", lambda: ["avx2"])
    with pytest.raises(tessuto.ProcessorError, match="lacks avx2") as caught:
        _processor.check()
    assert caught.value.exit_code == 6 and isinstance(caught.value, ImportError)
    monkeypatch.setenv("TESSUTO_ANY_PROCESSOR", "1")
    _processor.check()


def test_the_program_stops_at_ctrl_c_as_ever(scene_folder: Path, tmp_path: Path) -> None:
    path = Path(sysconfig.get_path("scripts")) / "tessuto"
    arguments = [str(path), "reconstruct", str(scene_folder), "--out", str(tmp_path / "out"), "--no-appearance"]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, text=True) as running:
        assert running.stderr is not None
        for line in running.stderr:
            if line.startswith("stage 1"):
                running.send_signal(signal.SIGINT)
                break
        told = running.stderr.read()
    assert running.returncode == 75, told
    assert "go on with: tessuto reconstruct" in told and not (tmp_path / "out").exists()
