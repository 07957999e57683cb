#!/usr/bin/env python3
"""Kills a reconstruction again and again, resumes it, and compares the result with that of an undisturbed run.

usage: kill_and_resume.py TESSUTO [--kills 50] [--seed 0] [--preset default|saft]

Every kill is SIGKILL at a random moment of the run. Prints one line per kill and ends with status 1 if any byte
differs.
"""

import argparse, filecmp, random, shutil, subprocess, sys, tempfile, time
from pathlib import Path

COMPARED = [
    "motion.npy",
    "forces.npy",
    "parameters.json",
    "history.csv",
    "texture.png",
    "metrics.json",
    "material/diffuse.png",
    "material/environment.exr",
    "rerendered/rgb_005.png",
    "export/scene.glb",
]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tessuto")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--preset", default="default")
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    folder = Path(tempfile.mkdtemp())
    quiet = dict(stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    scene = folder / "scene"
    subprocess.run(
        [arguments.tessuto, "synth", scene, "--frames", "6", "--size", "96", "--grid", "9x9"], check=True, **quiet
    )

    def command(out, *more):
        settings = [
            "texture.size=64",
            "appearance.steps=80",
            "appearance.batch=1000",
            "appearance.map_size=64",
            "appearance.render_samples_per_pixel=8",
        ]
        sets = [word for setting in settings for word in ("--set", setting)]
        return [
            arguments.tessuto,
            "reconstruct",
            scene,
            "--out",
            out,
            "--preset",
            arguments.preset,
            "--checkpoint",
            "0.2",
            *sets,
            *more,
        ]

    whole = folder / "whole"
    start = time.time()
    subprocess.run(command(whole), check=True, **quiet)
    seconds = time.time() - start
    print(f"undisturbed: {seconds:.1f} s")
    same = 0
    for k in range(arguments.kills):
        out = folder / "killed"
        for path in folder.glob("killed*"):
            shutil.rmtree(path)
        moment = rng.uniform(0, seconds)
        process = subprocess.Popen(command(out), **quiet)
        try:
            process.wait(moment)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        checkpoints = (
            len(list((folder / "killed.checkpoints").glob("*"))) if (folder / "killed.checkpoints").exists() else 0
        )
        if not out.exists():
            subprocess.run(command(out, "--resume"), check=True, **quiet)
        different = [name for name in COMPARED if not filecmp.cmp(whole / name, out / name, shallow=False)]
        same += not different
        print(
            f"{k + 1:3} killed after {moment:5.2f} s with {checkpoints} checkpoints: "
            f"{'different: ' + ' '.join(different) if different else 'the same'}",
            flush=True,
        )
    print(f"{same} of {arguments.kills} the same")
    shutil.rmtree(folder)
    sys.exit(same != arguments.kills)


main()
