#!/usr/bin/env python3
"""Reconstructs many made-up scenes with random settings; tells what failed and where the error was largest.

usage: stress.py TESSUTO [--scenes 200] [--seed 0] [--minutes M]

Each scene has a random size of cloth and picture, sort of mesh, number of vertices and frames, stiffnesses, wind, shading, frame rate
and print. A run fails if it ends with a status other than 0, or leaves a motion that is not finite. Ends with status 1 if
any did. The same seed makes the same scenes.
"""
import argparse, json, random, shutil, subprocess, sys, tempfile, time
from pathlib import Path

import numpy as np


def options(rng):
    """Random options of `tessuto synth`."""
    def log(low, high):
        return float(f"{10 ** rng.uniform(low, high):.3g}")
    return {
        "frames": rng.randint(2, 16), "size": rng.choice([48, 64, 96, 128, 160]),
        "grid": f"{rng.randint(3, 17)}x{rng.randint(3, 17)}", "wind": round(rng.uniform(0, 25), 2),
        "stretch": log(1, 3.5), "bend": log(-5, -2), "shear": log(-5, -2), "shading": round(rng.uniform(0, 1), 2),
        "fps": rng.choice([15, 24, 25, 30, 50, 60, 120]), "seed": rng.randrange(1 << 31),
        "mesh": rng.choice(["quads", "triangles", "irregular"]),
    }


def run(arguments):
    done = subprocess.run([str(a) for a in arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    return done.returncode, done.stderr.strip().splitlines()


def try_scene(program, folder, chosen, seed):
    """(what went wrong or None, vertex error [m] or None, seconds)."""
    scene, out = folder / "scene", folder / "result"
    words = [word for key, value in chosen.items() for word in (f"--{key}", value)]
    start = time.time()
    status, said = run([program, "synth", scene, "--force", *words])
    if status:
        return f"synth ended with {status}: {said[:2]}", None, time.time() - start
    status, said = run([program, "reconstruct", scene, "--out", out, "--force", "--no-appearance", "--seed", seed, "--set", "texture.size=128"])
    seconds = time.time() - start
    if status:
        errors = [line for line in said if line.startswith("error") or "panicked" in line or "hint" in line]
        return f"reconstruct ended with {status}: {errors[:3]}", None, seconds
    motion = np.load(out / "motion.npy")
    if not np.isfinite(motion).all():
        return f"{np.isnan(motion).sum()} numbers of the motion are not finite", None, seconds
    return None, json.loads((out / "metrics.json").read_text())["mean"]["vertex"], seconds


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tessuto")
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no scene after this time")
    arguments = parser.parse_args()
    rng = random.Random(arguments.seed)
    folder = Path(tempfile.mkdtemp())
    start, failures, errors = time.time(), [], []
    for k in range(arguments.scenes):
        if time.time() - start > 60 * arguments.minutes:
            break
        chosen = options(rng)
        home = folder / str(k)
        home.mkdir()
        problem, error, seconds = try_scene(Path(arguments.tessuto).resolve(), home, chosen, k)
        shutil.rmtree(home)
        words = " ".join(f"--{key} {value}" for key, value in chosen.items())
        if problem:
            failures.append((problem, words))
        else:
            errors.append((error, words))
        print(f"{k + 1:3} {seconds:6.1f} s  {problem or f'vertex error {1000 * error:.2f} mm'}  {words}", flush=True)
    shutil.rmtree(folder)
    print(f"\n{len(failures) + len(errors)} scenes, {len(failures)} failed")
    for problem, words in failures:
        print(f"FAILED {problem}\n       {words}")
    if errors:
        values = np.array([error for error, _ in errors])
        print(f"vertex error: median {1000 * np.median(values):.2f} mm, 90 % below {1000 * np.quantile(values, 0.9):.2f} mm; the worst ten:")
        for error, words in sorted(errors, reverse=True)[:10]:
            print(f"{1000 * error:8.2f} mm  {words}")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
