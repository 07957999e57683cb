#!/usr/bin/env python3
"""Runs workflow/ on made-up scenes and looks at everything it promises; ends with status 1 at the first promise broken.

usage: check_workflow.py TESSUTO SNAKEMAKE [--full | --slurm]

Short: three tiny scenes and a broken one. What ends with 3 is tried once, 75 and SIGKILL again; a repaired
scene, another value of a setting and another column compute what they touch and nothing else; results are
sealed; links lead somewhere.

--slurm: the same on a cluster: tools/slurm_node.sh tools/check_workflow.py TESSUTO SNAKEMAKE --slurm

--full: twelve scenes on two workers, and again with a worker killed, the whole run interrupted, and the whole
run killed, to the same summary, byte for byte. Prints the time against two plain loops over the same commands,
one thread each.
"""

import argparse
import csv
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TINY = {
    "texture.size": 64,
    "spacetime.iterations": 4,
    "appearance.steps": 40,
    "appearance.batch": 500,
    "appearance.map_size": 64,
    "appearance.render_samples_per_pixel": 8,
}
SMALL = {
    "texture.size": 128,
    "appearance.steps": 40,
    "appearance.batch": 2000,
    "appearance.map_size": 64,
    "appearance.render_samples_per_pixel": 16,
}
# Ends the first reconstruction with 75, kills the second with SIGKILL, and writes down every call.
SHIM = """#!/bin/bash
echo "$*" >> "{calls}"
if [[ $1 == reconstruct && $2 == *c1 ]]; then
    case $(grep -c "^reconstruct [^ ]*c1 " "{calls}") in
        1) exit 75 ;;
        2) kill -KILL $$ ;;
    esac
fi
exec "{tessuto}" "$@"
"""


class Workflow:
    """A folder with a table of scenes, and the workflow run in it."""

    def __init__(self, folder, snakemake, tessuto, settings, slurm=False):
        self.folder, self.snakemake, self.tessuto = folder, snakemake, tessuto
        profile = [
            "slurm",
            "--jobs",
            "2",
            "--latency-wait",
            "5",
            "--slurm-init-seconds-before-status-checks",
            "1",
            "--slurm-no-account",
            "--slurm-status-command",
            "squeue",
            "--seconds-between-status-checks",
            "2",
        ]
        self.profile = profile if slurm else ["local", "--cores", "2"]
        (folder / "settings.yaml").write_text(f"set: {json.dumps(settings)}\n")

    def start(self, out, *more):
        command = [
            self.snakemake,
            "--snakefile",
            ROOT / "workflow/Snakefile",
            "--profile",
            ROOT / "workflow/profiles" / self.profile[0],
            *self.profile[1:],
            "--configfile",
            "settings.yaml",
            "--config",
            f"tessuto={self.tessuto}",
            f"out={out}",
            "checkpoint=1",
            *more,
        ]
        log = open(self.folder / "log", "a")
        # A group of its own, as a terminal gives to what runs in its foreground.
        return subprocess.Popen(
            list(map(str, command)), cwd=self.folder, stdout=log, stderr=log, start_new_session=True
        )

    def run(self, out, *more):
        return self.start(out, *more).wait()

    def rows(self, out):
        with open(self.folder / out / "summary.csv", newline="") as file:
            return list(csv.DictReader(file))

    def summary(self, out):
        return [(self.folder / out / name).read_bytes() for name in ["summary.csv", "summary.html"]]

    def notes(self, out):
        """When the note of every step of every run was written."""
        return {
            str(path.relative_to(self.folder / out / "steps")): path.stat().st_mtime_ns
            for path in (self.folder / out / "steps").glob("*/*.json")
        }

    def table(self, *lines):
        (self.folder / "scenes.csv").write_text("\n".join(lines) + "\n")

    def scene(self, name, frames, size, grid, seed):
        self.program(
            "synth", f"scenes/{name}", "--frames", frames, "--size", size, "--grid", f"{grid}x{grid}", "--seed", seed
        )

    def program(self, *words):
        return subprocess.run([self.tessuto, *map(str, words)], cwd=self.folder, check=True, capture_output=True)


def promise(kept, what):
    print(f"{'ok    ' if kept else 'BROKEN'} {what}", flush=True)
    if not kept:
        sys.exit(1)


def touched(before, after):
    return {note for note, written in after.items() if before.get(note) != written}


def short(flow, real):
    for seed, name in enumerate(["c1", "c2", "broken"]):
        flow.scene(name, 4, 64, 7, seed)
    shutil.rmtree(flow.folder / "scenes/broken/masks")
    flow.table("scene", "scenes/c1", "scenes/c2", "scenes/broken")
    status, rows = flow.run("out"), flow.rows("out")
    made = (flow.folder / "calls").read_text().splitlines()
    promise(
        status != 0 and [row["state"] for row in rows] == ["failed", "found", "found"],
        "a broken scene stands first in the summary, the others are done",
    )
    promise(
        "check, status 3" in rows[0]["message"] and "hint: " in rows[0]["message"], f"its message: {rows[0]['message']}"
    )
    promise(sum(call.startswith("check scenes/broken") for call in made) == 1, "status 3 is not tried again")
    tries = [call for call in made if call.startswith("reconstruct scenes/c1")]
    promise(
        len(tries) == 3 and ["--resume" in call for call in tries] == [False, True, True],
        "status 75 and SIGKILL are, with --resume",
    )

    before = flow.notes("out")
    shutil.rmtree(flow.folder / "scenes/broken")
    flow.scene("broken", 4, 64, 7, 9)
    status, after = flow.run("out"), flow.notes("out")
    promise(status == 0 and all(row["state"] == "found" for row in flow.rows("out")), "a repaired scene is computed")
    promise(
        touched(before, after)
        == {f"{step}/broken.json" for step in ["check", "reconstruct", "evaluate", "appearance", "report"]},
        "and nothing else",
    )
    for row in flow.rows("out"):
        real.program("verify", f"out/results/{row['run']}")
    links = re.findall(r'href="([^"]*)"', (flow.folder / "out/summary.html").read_text())
    promise(
        len(links) == 3 and all((flow.folder / "out" / link).is_file() for link in links),
        "results are sealed, links of the summary lead to pages",
    )

    summary = flow.summary("out")
    promise(
        flow.run("out") == 0 and not touched(after, flow.notes("out")) and flow.summary("out") == summary,
        "a second call computes nothing",
    )
    flow.table("scene,spacetime.iterations", "scenes/c1,", "scenes/c2,3|5", "scenes/broken,")
    status, swept = flow.run("out"), flow.notes("out")
    promise(
        status == 0
        and touched(after, swept)
        == {
            f"{step}/c2@spacetime.iterations={n}.json"
            for n in [3, 5]
            for step in ["reconstruct", "evaluate", "appearance", "report"]
        },
        "a sweep computes its runs and nothing else",
    )
    promise(
        [row["spacetime.iterations"] for row in sorted(flow.rows("out"), key=lambda row: row["run"])]
        == ["", "", "3", "5"],
        "and is a column of the summary",
    )
    calls = lambda: [call for call in (flow.folder / "calls").read_text().splitlines() if call != "--version"]
    before = calls()
    for name in ["summary.csv", "steps/report/c1.json", "steps/reconstruct/c1.json"]:
        (flow.folder / "out" / name).unlink()
    promise(flow.run("out") == 0 and calls() == before, "lost notes are written again without work")
    promise(not (flow.folder / "out/summary-so-far.csv").exists(), "no summary is left of a part")
    promise(
        flow.run("motion", "appearance=false") == 0 and not (flow.folder / "motion/results/c1/material").exists(),
        "material and light are left out where asked",
    )
    flow.table("scene,spacetime.iteration", "scenes/c1,3")
    promise(
        flow.run("wrong") != 0 and flow.rows("wrong")[0]["message"].startswith("reconstruct, status 2: error"),
        "the summary shows what the program says of a mistyped setting",
    )


def wait_for(found, what):
    deadline = time.time() + 120
    while not (value := found()):
        if time.time() > deadline:
            promise(False, f"within two minutes there is {what}")
        time.sleep(0.05)
    return value


def workers(flow, out):
    """Processes that reconstruct into `out`."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = path.read_bytes().split(b"\0")
            if (
                words[1:2] == [b"reconstruct"]
                and os.readlink(path.parent / "cwd") == str(flow.folder)
                and any(w.startswith(f"{out}/".encode()) for w in words)
            ):
                found.append(int(path.parent.name))
        except OSError:
            pass  # it has ended
    return found


def loops(flow, names):
    """Two plain loops over the commands, a half of the scenes each."""
    sets = lambda appearance: " ".join(
        f"--set {key}={value}" for key, value in SMALL.items() if key.startswith("appearance.") == appearance
    )
    script = f"""set -e; export RAYON_NUM_THREADS=1; for name in "$@";
        do t={flow.tessuto}; s=scenes/$name; r=plain/$name
        $t check $s --picture plain/$name.png
        $t reconstruct $s --out $r --no-appearance --threads 1 --checkpoint 1 {sets(False)}
        $t evaluate $s $r --json; $t appearance $s $r --threads 1 {sets(True)}
        $t report $r --threads 1; $t verify $r; done"""
    shutil.rmtree(flow.folder / "plain", ignore_errors=True)
    (flow.folder / "plain").mkdir()
    running = [
        subprocess.Popen(
            ["bash", "-c", script, "loop", *part], cwd=flow.folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for part in [names[::2], names[1::2]]
    ]
    promise([process.wait() for process in running] == [0, 0], "two plain loops end well")


def cpu():
    """Processor seconds of everything that this script has run and waited for."""
    times = os.times()
    return times.children_user + times.children_system


def full(flow):
    names = [f"c{number:02}" for number in range(12)]
    for seed, name in enumerate(names):
        flow.scene(name, 16, 192, 13, seed)
    flow.table("scene", *(f"scenes/{name}" for name in names))
    used = [time.time(), cpu()]
    loops(flow, names)
    plain = [time.time() - used[0], cpu() - used[1]]
    used = [time.time(), cpu()]
    promise(flow.run("whole") == 0, "twelve scenes, undisturbed")
    workflow = [time.time() - used[0], cpu() - used[1]]
    for what, a, b in zip(["by the clock", "of processors"], plain, workflow):
        print(
            f"seconds {what}: two plain loops {a:.1f}, workflow {b:.1f}: efficiency {a / b:.3f}; load "
            f"{os.getloadavg()[0]:.1f}",
            flush=True,
        )

    process = flow.start("disturbed")
    os.kill(wait_for(lambda: workers(flow, "disturbed"), "a worker")[0], signal.SIGKILL)
    wait_for(
        lambda: len(list((flow.folder / "disturbed/steps").glob("reconstruct/*.json"))) >= 3, "a third reconstruction"
    )
    wait_for(lambda: workers(flow, "disturbed"), "a worker")
    os.killpg(process.pid, signal.SIGINT)
    promise(
        process.wait() != 0 and not workers(flow, "disturbed"),
        "one worker killed, then the whole run interrupted: all have ended",
    )
    done = flow.notes("disturbed")
    process = flow.start("disturbed")
    wait_for(lambda: len(flow.notes("disturbed")) > len(done) + 8 and workers(flow, "disturbed"), "an eighth step more")
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    promise(
        flow.run("disturbed", "--unlock") == 0 and flow.run("disturbed") == 0, "then the whole run killed, and finished"
    )
    promise(flow.summary("disturbed") == flow.summary("whole"), "to the same summary, byte for byte")
    motion = lambda out, name: (flow.folder / out / "results" / name / "motion.npy").read_bytes()
    promise(all(motion("disturbed", name) == motion("whole", name) for name in names), "and the same motions")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tessuto", type=Path)
    parser.add_argument("snakemake")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--slurm", action="store_true")
    arguments = parser.parse_args()
    tessuto = arguments.tessuto.resolve()
    # In the background of a script Ctrl-C is ignored, and so by all that is started here; not now.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder).resolve()
        real = Workflow(folder, arguments.snakemake, tessuto, SMALL if arguments.full else TINY)
        try:
            if arguments.full:
                return full(real)
            shim = folder / "tessuto"
            shim.write_text(SHIM.format(calls=folder / "calls", tessuto=tessuto))
            shim.chmod(0o755)
            short(Workflow(folder, arguments.snakemake, shim, TINY, arguments.slurm), real)
        except SystemExit:
            print((folder / "log").read_text()[-4000:], file=sys.stderr)
            raise


main()
