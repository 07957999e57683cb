#!/usr/bin/env python3
"""Reconstructs many made-up scenes with random settings; reports what failed and where the error was largest.

usage: stress.py TESSUTO [--scenes 200] [--seed 0] [--minutes M] [--csv FILE] [--only KIND]

Each scene has a random size of cloth and picture, sort of mesh, number of vertices and frames, stiffnesses,
wind, shading, frame rate and print. About half of them have one or more of the kinds hands, paper, occluders,
amodal, blur, slow (10 or 12 frames/s). A run fails if it ends with a status other than 0, or leaves a motion
that is not finite. Ends with status 1 if any did. The same seed makes the same scenes, and the same ones, except
for their kinds, as before there were kinds.

At the end it also reports which part of the frames that are off by more than 15 mm the results' own verdicts
flag, and which of the others: goals are 90 % and 5 %.

--csv FILE  one row per frame: scene, kinds, frame, mean error of its vertices [mm], the columns of the result's
            verdict on the frame, as far as metrics.json has any, and the quantities that it judges by
"""

import argparse, csv, json, random, shutil, subprocess, sys, tempfile, time
from pathlib import Path

import numpy as np


def options(rng):
    """Random options of `tessuto synth`."""

    def log(low, high):
        return float(f"{10 ** rng.uniform(low, high):.3g}")

    return {
        "frames": rng.randint(2, 16),
        "size": rng.choice([48, 64, 96, 128, 160]),
        "grid": f"{rng.randint(3, 17)}x{rng.randint(3, 17)}",
        "wind": round(rng.uniform(0, 25), 2),
        "stretch": log(1, 3.5),
        "bend": log(-5, -2),
        "shear": log(-5, -2),
        "shading": round(rng.uniform(0, 1), 2),
        "fps": rng.choice([15, 24, 25, 30, 50, 60, 120]),
        "seed": rng.randrange(1 << 31),
        "mesh": rng.choice(["quads", "triangles", "irregular"]),
    }


KINDS = ["hands", "paper", "occluders", "amodal", "blur", "slow"]


def with_kinds(chosen, rng):
    """(options with random kinds, their names): none of them in about half of the scenes."""
    drawn = {
        "mover": rng.choice(["hands", "paper", None]),
        "occluders": rng.random() < 0.4,
        "amodal": rng.random() < 0.4,
        "blur": rng.random() < 0.4,
        "slow": rng.random() < 0.3,
    }
    light, exposure, rate, several = (
        round(rng.uniform(0, 5), 2),
        round(rng.uniform(0.2, 0.9), 2),
        rng.choice([10, 12]),
        rng.random() < 0.2,
    )
    if rng.random() >= 0.55:
        return chosen, []
    chosen, kinds = dict(chosen), []
    if drawn["mover"] == "hands":
        chosen |= {"hands": True, "wind": light}
    elif drawn["mover"] == "paper":
        chosen = {key: value for key, value in chosen.items() if key not in ("wind", "stretch", "bend", "shear")} | {
            "paper": True
        }
    if drawn["mover"]:
        kinds.append(drawn["mover"])
    if drawn["occluders"]:
        chosen["occluders"] = 2 if several else 1
        kinds.append("occluders")
        if drawn["amodal"]:
            chosen["amodal"] = True
            kinds.append("amodal")
    if drawn["blur"]:
        chosen["blur"] = exposure
        kinds.append("blur")
    if drawn["slow"]:
        chosen["fps"] = rate
        kinds.append("slow")
    return chosen, kinds


def words_of(chosen):
    """The options as words of a command line; those whose number is optional take it after an equals sign."""
    return [
        word
        for key, value in chosen.items()
        for word in (
            [f"--{key}"]
            if value is True
            else [f"--{key}={value}"]
            if key in ("occluders", "blur")
            else [f"--{key}", str(value)]
        )
    ]


def run(arguments):
    done = subprocess.run([str(a) for a in arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    return done.returncode, done.stderr.strip().splitlines()


def try_scene(program, folder, chosen, seed):
    """(what went wrong or None, metrics of every frame or None, seconds)."""
    scene, out = folder / "scene", folder / "result"
    start = time.time()
    status, said = run([program, "synth", scene, "--force", *words_of(chosen)])
    if status:
        return f"synth ended with {status}: {said[:2]}", None, time.time() - start
    status, said = run(
        [
            program,
            "reconstruct",
            scene,
            "--out",
            out,
            "--force",
            "--no-appearance",
            "--seed",
            seed,
            "--set",
            "texture.size=128",
        ]
    )
    seconds = time.time() - start
    if status:
        errors = [line for line in said if line.startswith("error") or "panicked" in line or "hint" in line]
        return f"reconstruct ended with {status}: {errors[:3]}", None, seconds
    motion = np.load(out / "motion.npy")
    if not np.isfinite(motion).all():
        return f"{np.isnan(motion).sum()} numbers of the motion are not finite", None, seconds
    return None, json.loads((out / "metrics.json").read_text()), seconds


def rows(scene, kinds, metrics):
    """One row per frame: its error, and what the result itself says about the frame."""
    verdicts = {entry["frame"]: entry for entry in metrics.get("verdicts", [])}
    agreement = {entry["frame"]: entry for entry in metrics.get("agreement", [])}
    return [
        {
            "scene": scene,
            "kinds": "+".join(kinds) or "wind",
            "frame": f["frame"],
            "error_mm": round(1000 * f["vertex"], 4),
            **{f"verdict_{key}": value for key, value in verdicts.get(f["frame"], {}).items() if key != "frame"},
            **{key: value for key, value in agreement.get(f["frame"], {}).items() if key != "frame"},
        }
        for f in metrics["frames"]
    ]


def write_csv(path, table):
    """Columns: those of every row, then those that some rows have, in the order in which they appear."""
    columns = list(dict.fromkeys(key for row in table for key in row))
    with open(path, "w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(table)


def summary(name, values):
    print(
        f"{name}: {len(values)}; median {np.median(values):.2f} mm, 90 % below {np.quantile(values, 0.9):.2f} "
        f"mm, worst {values.max():.2f} mm"
    )


def flags(table, limit=15):
    """How well the verdicts show which frames are off by more than `limit` mm: shares of these that are flagged
    (doubtful or lost), and of the others (false alarms)."""
    judged = [row for row in table if row.get("verdict_state")]
    for name, off in [(f"frames off by more than {limit} mm", True), ("the other frames", False)]:
        states = [row["verdict_state"] for row in judged if (row["error_mm"] > limit) == off]
        if states:
            share = {state: 100 * states.count(state) / len(states) for state in ("doubtful", "lost")}
            print(
                f"{name}: {len(states)}; flagged {sum(share.values()):.1f} % ({share['doubtful']:.1f} % "
                f"doubtful, {share['lost']:.1f} % lost)"
            )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tessuto")
    parser.add_argument("--scenes", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no scene after this time")
    parser.add_argument("--csv", type=Path)
    parser.add_argument(
        "--only", choices=[*KINDS, "wind"], help="try only the scenes with this kind, or without any (wind)"
    )
    arguments = parser.parse_args()
    rng, kinds_rng = random.Random(arguments.seed), random.Random(f"kinds {arguments.seed}")
    folder = Path(tempfile.mkdtemp())
    start, failures, errors, table = time.time(), [], [], []
    for k in range(arguments.scenes):
        if time.time() - start > 60 * arguments.minutes:
            break
        chosen, kinds = with_kinds(options(rng), kinds_rng)
        if arguments.only and arguments.only not in (kinds or ["wind"]):
            continue
        home = folder / str(k)
        home.mkdir()
        problem, metrics, seconds = try_scene(Path(arguments.tessuto).resolve(), home, chosen, k)
        shutil.rmtree(home)
        words = " ".join(words_of(chosen))
        if problem:
            failures.append((problem, words))
        else:
            frames = rows(k, kinds, metrics)
            table += frames
            worst = max(frames, key=lambda row: row["error_mm"])
            errors.append((1000 * metrics["mean"]["vertex"], words))
        said = problem or f"vertex error {errors[-1][0]:.2f} mm, frame {worst['frame']} {worst['error_mm']:.2f} mm"
        print(f"{k:3} {seconds:6.1f} s  {said}  {words}", flush=True)
        if arguments.csv:
            write_csv(arguments.csv, table)
    shutil.rmtree(folder)
    print(f"\n{len(failures) + len(errors)} scenes, {len(failures)} failed")
    for problem, words in failures:
        print(f"FAILED {problem}\n       {words}")
    if errors:
        summary("scenes", np.array([error for error, _ in errors]))
        summary("frames", np.array([row["error_mm"] for row in table]))
        for kind in ["wind", *KINDS]:
            values = [row["error_mm"] for row in table if kind in row["kinds"].split("+")]
            if values:
                summary(f"frames with {kind}", np.array(values))
        flags(table)
        print("the worst ten scenes:")
        for error, words in sorted(errors, reverse=True)[:10]:
            print(f"{error:8.2f} mm  {words}")
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
