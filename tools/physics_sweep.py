#!/usr/bin/env python3
"""How well `tessuto reconstruct` finds causes: made scenes of random stiffness, tilt, wind and hands with all causes as
truth (`tessuto synth --air`), compared by `tessuto evaluate`. Prints a line per scene and the table of all.

The parameters asked for are of docs/experiments/log/physics.md: the factor that bend and shear are off by
(median), the part of the scenes whose truth lies within two standard deviations, gravity's angle, and the error
of the futures in still air and with ten times the bend stiffness over that of the best guess without causes.

usage: tools/physics_sweep.py PROGRAM [--scenes 12] [--seed 100] [--minutes 40] [--frames 30] [--size 256]
    [--jsonl sweep.jsonl]

Needs NumPy. Exit status 1 if a scene failed.
"""

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np


def options(rng, frames, size):
    """Random options of `tessuto synth`: every other scene is carried by hands."""

    def log(low, high):
        return float(f"{10 ** rng.uniform(low, high):.3g}")

    side = rng.randint(13, 19)
    chosen = {
        "frames": frames,
        "size": size,
        "grid": f"{side}x{rng.randint(13, 19)}",
        "stretch": log(2, 2.8),
        "bend": log(-3.5, -2.5),
        "shear": log(-4, -3),
    }
    hands = rng.random() < 0.5
    wind = round(rng.uniform(0.5, 2.5), 2)
    return chosen | ({"hands": True} if hands else {"wind": wind})


def words_of(chosen):
    """The options as words of a command line."""
    return [
        word for key, value in chosen.items() for word in ([f"--{key}"] if value is True else [f"--{key}", str(value)])
    ]


def run(arguments):
    done = subprocess.run([str(a) for a in arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode:
        errors = [
            line
            for line in done.stderr.splitlines()
            if line.startswith("error") or "panicked" in line or "hint" in line
        ]
        raise RuntimeError(f"{arguments[1]} ended with {done.returncode}: {errors[:3]}")
    return done.stdout


def try_scene(program, folder, chosen, seed, extra):
    """What `tessuto evaluate --json` says of the scene."""
    scene, out = folder / "scene", folder / "result"
    run([program, "synth", scene, "--air", "--seed", seed, *words_of(chosen)])
    run([program, "reconstruct", scene, "--out", out, "--no-appearance", *extra])
    return json.loads(run([program, "evaluate", scene, out, "--json"]))


def of(results, *keys):
    """The values that the results have at `keys`."""
    values = []
    for value in results:
        for key in keys:
            value = value.get(key) if value is not None else None
        if value is not None:
            values.append(value)
    return values


def table(results):
    """Lines of text."""
    lines = [f"{len(results)} scenes", "| | median | worst | truth within 2 sd | informed |", "|---|---|---|---|---|"]
    for key in ["stretch", "bend", "shear", "drag"]:
        off = np.array([10 ** abs(v) for v in of(results, "causes", key, "log10")])
        if len(off):
            inside, informed = (100 * np.mean(of(results, "causes", key, word)) for word in ("inside", "informed"))
            soft = 100 * np.mean([v < 0 for v in of(results, "causes", key, "log10")])
            lines.append(
                f"| {key}, factor off ({soft:.0f} % too low) | {np.median(off):.2f} | {off.max():.2f} | "
                f"{inside:.0f} % | {informed:.0f} % |"
            )
    angle = np.array(of(results, "causes", "gravity", "degrees"))
    if len(angle):
        inside = 100 * np.mean(of(results, "causes", "gravity", "inside"))
        lines.append(f"| gravity, degrees off | {np.median(angle):.1f} | {angle.max():.1f} | {inside:.0f} % | |")
    held = of(results, "causes", "held")
    if held:
        right = sum(h["right"] for h in held)
        lines.append(
            f"| held vertices: {right} of {sum(h['truth'] for h in held)} found, "
            f"{sum(h['found'] for h in held) - right} that are not | | | | |"
        )
    for key, name in [("calm", "still air after the clip"), ("stiffer", "ten times the bend stiffness")]:
        ratio = np.array(of(results, "causes", key, "ratio"))
        if len(ratio):
            error = 1000 * np.median(of(results, "causes", key, "error"))
            lines.append(
                f"| {name}, ratio to the best guess without causes ({error:.1f} mm) | {np.median(ratio):.2f} | "
                f"{ratio.max():.2f} | | |"
            )
    rest = of(results, "causes", "unexplained")
    if rest:
        lines.append(f"| unexplained over the motion's acceleration | {np.median(rest):.1f} | {max(rest):.1f} | | |")
    vertex = of(results, "mean", "vertex")
    if vertex:
        lines.append(f"| vertices [mm] | {1000 * np.median(vertex):.2f} | {1000 * max(vertex):.2f} | | |")
    return lines


def in_short(result):
    causes = result["causes"]
    words = [
        f"{key} {10 ** causes[key]['log10']:.2f}{'' if causes[key]['inside'] else '!'}"
        for key in ("bend", "shear", "drag")
        if key in causes
    ]
    words += [f"gravity {causes['gravity']['degrees']:.1f}°"] + [
        f"{key} {causes[key]['ratio']:.2f}" for key in ("calm", "stiffer") if key in causes
    ]
    return ", ".join(words)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tessuto", type=Path)
    parser.add_argument("--scenes", type=int, default=12)
    parser.add_argument("--seed", type=int, default=100, help="of the first scene; the others follow")
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no scene after this time")
    parser.add_argument("--frames", type=int, default=30)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--jsonl", type=Path, help="append options and metrics of every scene")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="setting of reconstruct")
    arguments = parser.parse_args()
    program, extra = arguments.tessuto.resolve(), [word for change in arguments.set for word in ("--set", change)]
    folder, start = Path(tempfile.mkdtemp()), time.time()
    results, failures = [], []
    for seed in range(arguments.seed, arguments.seed + arguments.scenes):
        if time.time() - start > 60 * arguments.minutes:
            break
        chosen = options(random.Random(seed), arguments.frames, arguments.size)
        home, words = folder / str(seed), f"--seed {seed} {' '.join(words_of(chosen))}"
        home.mkdir()
        before = time.time()
        try:
            result = try_scene(program, home, chosen, seed, extra)
            results.append(result)
            said = in_short(result)
            if arguments.jsonl:
                with arguments.jsonl.open("a") as file:
                    file.write(
                        json.dumps(
                            {"seed": seed, "options": chosen, "causes": result["causes"], "mean": result.get("mean")}
                        )
                        + "\n"
                    )
        except RuntimeError as problem:
            failures.append(words)
            said = str(problem)
        shutil.rmtree(home)
        print(f"{seed:4} {time.time() - before:6.1f} s  {said}  {words}", flush=True)
    shutil.rmtree(folder)
    print("\n".join(["", *table(results)]))
    for words in failures:
        print(f"FAILED {words}")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
