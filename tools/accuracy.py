#!/usr/bin/env python3
"""How accurate `tessuto reconstruct` is, on clips that nobody tuned to: runs the league (scenes made by other
simulators, one family a difficulty), the shared scenes S1 to S4 and the recording R1, and compares with the
figures stored in docs/accuracy.md.

usage: tools/accuracy.py PROGRAM [--only small] [--update --why TEXT] [--scenes FOLDER …]
       [-- further options of reconstruct]

PROGRAM          the built program
--only small     the part that changes are judged by before they land: the list small.txt of the league
--update         store the new figures, of the scenes that ran; `--why` says in one line what changed, and is
                 kept below the table
--shared FOLDER  where data/ and tools/ are [../shared]
--work FOLDER    results of every scene; what is finished for this very program and these options is not run
                 again [target/accuracy]
--scenes …       other folders of scenes instead, whose table is printed and not stored
--jobs N         scenes at a time, each with one thread [2]

What counts, of every scene: the mean distance of its vertices from the truth over all frames; a frame is *off*
beyond 3 % of the sheet's size, the root of the template's area, in its mean. R1 has no vertices: its L1 Chamfer
distance stands in their place.

Exit status 1 if a scene failed, or if a family's mean error grew by more than a tenth of the stored one. Needs
NumPy (SciPy for R1).
"""

import argparse
import hashlib
import json
import math
import os
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "docs" / "accuracy.md"
OFF = 0.03
WORSE = 1.1
SHARED = ["S1", "S2", "S3", "S4", "R1"]
COLUMNS = [
    "scene",
    "family",
    "held still",
    "mean",
    "90 % of frames",
    "worst frame",
    "off frames",
    "of these flagged",
    "others flagged",
    "truth within two deviations",
    "seconds",
]
HEAD = """# Accuracy

Made by `tools/accuracy.py`; all figures by one set of settings, the default. Distance of vertices from the truth in
mm; of R1, which has no true vertices, the L1 Chamfer distance. *Held still*: the error of a program that does
nothing. A frame is *off* beyond 3 % of the sheet's size in its mean error; *flagged* are frames that the verdict
calls doubtful or lost. Seconds: two scenes at a time with one thread each, for orientation.

The league's scenes are made by other simulators and a path tracer, one family for each difficulty (hung, curtain,
flag, strip: a part folds over the sheet, hands, turn: one side is lifted over and lies on the sheet, table, repeat:
a repeating print, plain: one colour, outline: no rectangle, film: light and exposure change, paper, springs); S1 to
S4 are shared scenes that settings were once chosen on, R1 is a recording.

"""


def read_obj(path):
    """Vertices and triangles."""
    vertices, triangles = [], []
    for line in open(path):
        words = line.split()
        if words and words[0] == "v":
            vertices.append([float(x) for x in words[1:4]])
        elif words and words[0] == "f":
            of = [int(word.split("/")[0]) - 1 for word in words[1:]]
            triangles += [[of[0], of[i], of[i + 1]] for i in range(1, len(of) - 1)]
    return np.array(vertices), np.array(triangles)


def size_of(scene):
    """Root of the template's area [m]."""
    x, t = read_obj(scene / "template.obj")
    return math.sqrt(0.5 * np.linalg.norm(np.cross(x[t[:, 1]] - x[t[:, 0]], x[t[:, 2]] - x[t[:, 0]]), axis=1).sum())


def measure(scene, result, shared):
    """The figures of one result; lengths in mm."""
    motion = np.load(result / "motion.npy").astype(float)
    metrics = json.loads((result / "metrics.json").read_text())
    flagged = {v["frame"] for v in metrics["verdicts"] if v["state"] != "found"}
    truth_file = scene / "gt/vertices.npy"
    if not truth_file.exists():
        out = result / "evaluated.json"
        command = [sys.executable, shared / "tools/evaluate.py", scene, result / "motion.npy", "--json", out]
        subprocess.run([str(c) for c in command], check=True, stdout=subprocess.DEVNULL)
        of = json.loads(out.read_text())
        per = 1e3 * np.array([row["cd1"] for row in of["frames"]])
        more = {"cd1": of["mean"]["cd1"], "cd2": of["mean"]["cd2"], "depth": of["mean"]["depth"]}
        return (
            figures(per, len(per), flagged) | {"off": None, "off_flagged": None, "others_flagged": len(flagged)} | more
        )
    truth = np.load(truth_file).astype(float)
    distance = np.linalg.norm(motion - truth, axis=2)
    per = 1e3 * distance.mean(axis=1)
    still = 1e3 * np.linalg.norm(truth - truth[0], axis=2).mean()
    out = figures(per, 1e3 * OFF * size_of(scene), flagged) | {"still": float(still)}
    deviation = result / "deviation.npy"
    if deviation.exists():
        out["within"] = float((distance[1:] <= 2.0 * np.load(deviation)[1:]).mean())
    return out


def figures(per, limit, flagged):
    """Of the error of every frame."""
    off = {int(n) for n in np.flatnonzero(per > limit)}
    return {
        "mean": float(per.mean()),
        "ninety": float(np.quantile(per, 0.9)),
        "worst": float(per.max()),
        "off": len(off),
        "off_flagged": len(off & flagged),
        "others_flagged": len(flagged - off),
        "frames": len(per),
    }


def run(program, key, scene, frames, args):
    """The figures of one scene, from before if they are known."""
    folder = args.work / key / scene.name
    stored = folder / "figures.json"
    if stored.exists():
        return json.loads(stored.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    result = folder / "result"
    command = [
        program,
        "reconstruct",
        scene,
        "--out",
        result,
        "--no-appearance",
        "--threads",
        1,
        "--force",
        *args.further,
    ]
    command += ["--frames", frames] if frames else []
    begun = time.monotonic()
    with open(folder / "log.txt", "w") as log:
        code = subprocess.run([str(c) for c in command], stdout=log, stderr=log, stdin=subprocess.DEVNULL).returncode
    if code:
        return {"failed": f"exit status {code}, see {folder / 'log.txt'}"}
    out = measure(scene, result, args.shared) | {"seconds": time.monotonic() - begun}
    temporary = stored.with_suffix(".part")
    temporary.write_text(json.dumps(out))
    os.replace(temporary, stored)
    return out


def family(name):
    return name.rsplit("-", 1)[0] if "-" in name else name


def geometric(values):
    return float(np.exp(np.mean(np.log(np.maximum(values, 1e-9)))))


def row(name, of):
    def number(key, digits=2, of=of):
        return "" if of.get(key) is None else f"{of[key]:.{digits}f}"

    return [
        name,
        family(name),
        number("still", 1),
        number("mean"),
        number("ninety"),
        number("worst"),
        number("off", 0),
        number("off_flagged", 0),
        number("others_flagged", 0),
        number("within"),
        number("seconds", 0),
    ]


def markdown(rows):
    lines = ["| " + " | ".join(COLUMNS) + " |", "|---" * len(COLUMNS) + "|"]
    return "\n".join(lines + ["| " + " | ".join(row(name, of)) + " |" for name, of in rows.items()])


def summary(rows):
    """What counts over the league."""
    league = {name: of for name, of in rows.items() if "-" in name}
    if not league:
        return ""
    means = [of["mean"] for of in league.values()]
    count = {key: sum(of[key] for of in league.values()) for key in ["off", "off_flagged", "others_flagged", "frames"]}
    within = [of["within"] for of in league.values() if "within" in of]
    text = (
        f"The league's {len(league)} scenes: geometric mean {geometric(means):.2f} mm, 90 % of scenes "
        f"{np.quantile(means, 0.9):.1f} mm, worst {max(means):.1f} mm; {count['off']} frames are off, "
        f"{count['off_flagged']} of them flagged; {count['others_flagged']} of the "
        f"{count['frames'] - count['off']} others flagged; truth within two deviations "
        f"{min(within, default=0):.2f} to {max(within, default=0):.2f}."
    )
    r1 = rows.get("R1")
    return text + (
        f" R1: CD1 {1e2 * r1['cd1']:.3f}·10⁻² m, CD2 {1e4 * r1['cd2']:.3f}·10⁻⁴ m², depth "
        f"{1e2 * r1['depth']:.3f}·10⁻² m."
        if r1 and "cd1" in r1
        else ""
    )


def stored_rows():
    """Lines of the table in docs/accuracy.md, one for each scene."""
    lines = TABLE.read_text().splitlines() if TABLE.exists() else []
    return [line for line in lines if re.match(r"\| [A-Za-z]+-?\d* \|", line) and not line.startswith("| scene ")]


def stored_means():
    """Mean error by scene, as docs/accuracy.md has it."""
    rows = [line.strip("| \n").split("|") for line in stored_rows()]
    return {cells[0].strip(): float(cells[3]) for cells in rows}


def grown(rows, stored):
    """Families whose geometric mean over the scenes that are known from before grew too much, each with both
    figures."""
    families = {}
    for name in rows:
        if name in stored:
            families.setdefault(family(name), []).append(name)
    compared = {
        f: (geometric([stored[n] for n in names]), geometric([rows[n]["mean"] for n in names]))
        for f, names in families.items()
    }
    return {f: pair for f, pair in compared.items() if pair[1] > WORSE * pair[0]}, compared


def reasons():
    """The lines below the stored table."""
    text = TABLE.read_text() if TABLE.exists() else ""
    return [line for line in text.partition("## What changed")[2].splitlines() if line.startswith("- ")]


def scenes_of(args):
    """Folders with ranges of frames."""
    if args.scenes:
        return [(Path(scene), None) for scene in args.scenes]
    league = args.shared / "data/league"
    if args.only == "small":
        lines = [
            line.split()
            for line in (league / "small.txt").read_text().splitlines()
            if line and not line.startswith("#")
        ]
        # A range that is the whole clip is none.
        whole = lambda name, frames: (
            frames == f"0..{json.loads((league / name / 'scene.json').read_text())['n_frames']}"
        )
        return [(league / name, None if whole(name, frames) else frames) for name, frames in lines]
    return [(path, None) for path in sorted(league.iterdir()) if path.is_dir()] + [
        (args.shared / "data" / name, None) for name in SHARED
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=Path)
    parser.add_argument("--only", choices=["small"])
    parser.add_argument("--update", action="store_true")
    parser.add_argument("--why", action="append", default=[])
    parser.add_argument("--shared", type=Path, default=ROOT.parent / "shared")
    parser.add_argument("--work", type=Path, default=ROOT / "target/accuracy")
    parser.add_argument("--scenes", nargs="+")
    parser.add_argument("--jobs", type=int, default=2)
    words = sys.argv[1:]
    cut = words.index("--") if "--" in words else len(words)
    args = parser.parse_args(words[:cut])
    args.further = words[cut + 1 :]
    if args.update and (args.scenes or args.further or not args.why):
        parser.error("--update needs the fixed scenes, without further options, and a reason: --why TEXT")
    program = args.program.resolve()
    key = hashlib.sha256(program.read_bytes() + repr(args.further).encode()).hexdigest()[:16]
    scenes = scenes_of(args)
    with ThreadPoolExecutor(args.jobs) as pool:
        # The longest first would need their times; R1 is known to be.
        order = sorted(scenes, key=lambda scene: scene[0].name not in SHARED)
        futures = {scene.name: pool.submit(run, program, key, scene, frames, args) for scene, frames in order}
        for name, future in futures.items():
            of = future.result()
            print(
                f"{name}: " + (of.get("failed") or f"{of['mean']:.2f} mm, {of['seconds']:.0f} s"),
                file=sys.stderr,
                flush=True,
            )
    rows = {scene.name: futures[scene.name].result() for scene, _ in scenes}
    failed = [name for name, of in rows.items() if "failed" in of]
    rows = {name: of for name, of in rows.items() if "failed" not in of}
    print(markdown(rows) + "\n\n" + summary(rows))
    worse, compared = grown(rows, stored_means())
    if not args.scenes:
        for name, (before, now) in compared.items():
            print(f"{name}: {before:.2f} -> {now:.2f} mm" + ("  WORSE" if name in worse else ""))
    if args.update and not failed:
        version = subprocess.run(
            ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
        ).stdout.strip()
        why = "\n".join([f"- {line}" for line in args.why] + reasons())
        what = f"{args.only or 'all'} after {version}, program {key}" if version else key
        kept = [line for line in stored_rows() if line.split("|")[1].strip() not in rows]
        table = "\n".join([markdown(rows), *kept])
        TABLE.write_text(
            f"{HEAD}Last stored: {what}. {summary(rows)}\n\n{table}\n\n## What changed, and why\n\n{why}\n"
        )
    for name in failed:
        print(f"{name} failed: {futures[name].result()['failed']}", file=sys.stderr)
    judged = bool(worse) and not args.update and not args.scenes and not args.further
    if judged:
        print(
            "a family is worse by more than a tenth: mend it, or store the new figures with --update and say --why",
            file=sys.stderr,
        )
    passed = len(rows) - (len(worse) if judged else 0)
    print(f"{passed} passed, {len(futures) - passed} failed")
    sys.exit(1 if failed or judged else 0)


main()
