#!/usr/bin/env python3
"""One step of one run: the program, and a note of how it ended. Called by the Snakefile.

What the exit status of the program means for the note:

  0              the step is done
  2, 3, 4, 101   it would end so again: noted as failed, and this script ends with 0, so that it is not tried
                 again and the other runs and the summary go on; the later steps of this run are passed over
  5, 6, 75, 137  a full disk, an old processor, an interruption, a kill (memory): no note, and this script ends
                 with the same status, so that Snakemake tries again, on another machine or with more memory

A note is found valid, without any work, if it was made by the same program from the same scene and options and
the result folder is as the workflow
left it: `records/RUN.json` knows. Snakemake removes the notes of a group of jobs of which one failed.
"""

import argparse
import fcntl
import hashlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

FOR_GOOD = {2, 3, 4, 101}


def main():
    parser = argparse.ArgumentParser(
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        epilog="Options for the program stand after --.",
    )
    parser.add_argument("step", choices=["check", "reconstruct", "evaluate", "appearance", "report"])
    parser.add_argument("--tessuto", required=True)
    parser.add_argument("--scene", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True, help="folder of the whole workflow")
    parser.add_argument("--run", required=True, help="name of the run; for check, of the scene")
    parser.add_argument("--threads", default="1")
    parser.add_argument("--after", type=Path, action="append", default=[], help="note of a step that must be done")
    parser.add_argument("--note", type=Path, required=True, help="note to write")
    words = sys.argv[1:]
    end = words.index("--") if "--" in words else len(words)
    arguments = parser.parse_args(words[:end])
    arguments.options = words[end + 1 :]
    arguments.note.parent.mkdir(parents=True, exist_ok=True)
    earlier = [json.loads(path.read_text()) for path in arguments.after]
    failed = [note for note in earlier if note["status"]]
    # The motion's page is made without the steps after it too.
    if failed and (arguments.step != "report" or failed[0]["step"] in ["check", "reconstruct"]):
        return write(arguments.note, failed[0])
    with Record(arguments) as record:
        key = digest(
            [
                arguments.step,
                program(arguments.tessuto),
                arguments.options,
                [note["key"] for note in earlier],
                arguments.step == "check" and scene_key(arguments.scene),
            ]
        )
        note = record.valid(key)
        if note is None:
            note = work(arguments, key, record)
            record.done(key, note)
        write(arguments.note, note)


def work(arguments, key, record):
    """Runs the program; the note. Ends this script if the step is to be tried again."""
    result = arguments.out / "results" / arguments.run
    scene, step = arguments.scene, arguments.step
    words = {
        "check": ["check", scene, "--picture", arguments.note.with_suffix(".png")],
        "reconstruct": [
            "reconstruct",
            scene,
            "--out",
            result,
            "--no-appearance",
            "--threads",
            arguments.threads,
            "--force",
        ],
        "evaluate": ["evaluate", scene, result, "--json"],
        "appearance": ["appearance", scene, result, "--threads", arguments.threads],
        "report": ["report", result, "--threads", arguments.threads],
    }[step]
    if step == "evaluate" and not (scene / "gt").is_dir():
        return {"step": step, "key": key, "status": 0, "errors": None}
    if step == "reconstruct" and record.begin(key):
        words.append("--resume")  # checkpoints of another scene or other settings would be refused
    command = [arguments.tessuto, *map(str, words), *arguments.options]
    log = arguments.out / "logs" / step / f"{arguments.run}.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    result.parent.mkdir(parents=True, exist_ok=True)
    started = time.monotonic()
    status, said = run(command, log, arguments.threads, record)
    if step == "report" and status == 0:
        status, _ = run([arguments.tessuto, "verify", str(result)], log, arguments.threads, record)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status and status not in FOR_GOOD:
        print(f"{' '.join(command)}: status {status}, to be tried again; see {log}", file=sys.stderr)
        sys.exit(status)
    note = {"step": step, "key": key, "status": status, "seconds": round(time.monotonic() - started, 2)}
    note |= {"cpu_seconds": round(usage.ru_utime + usage.ru_stime, 2), "peak_mb": usage.ru_maxrss // 1024}
    if status:
        lines = log.read_text(errors="replace").splitlines()
        errors = [i for i, line in enumerate(lines) if line.startswith("error")]
        note["message"] = "\n".join(lines[errors[-1] if errors else -1 :])[:2000]
    elif step == "evaluate":
        note["errors"] = json.loads(said)["mean"]
    return note


def run(command, log, threads, record):
    """Status of `command` and what it printed; all of that goes to the log too. One request to stop is passed
    on, once."""
    with open(log, "a") as file:
        print("$", *command, file=file, flush=True)
        # In a session of its own, so that Ctrl-C reaches it once, from here. It keeps the lock if this script
        # is killed.
        environment = dict(os.environ, RAYON_NUM_THREADS=threads)
        try:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=file,
                start_new_session=True,
                pass_fds=[record.lock.fileno()],
                env=environment,
            )
        except OSError as error:
            sys.exit(f"cannot run {command[0]}: {error.strerror}; name the program with --config tessuto=FILE")
        asked = []

        def stop(number, _):
            if not asked:
                process.terminate()
            asked.append(number)

        earlier = {number: signal.signal(number, stop) for number in [signal.SIGINT, signal.SIGTERM]}
        said = process.stdout.read().decode(errors="replace")
        status = process.wait()
        for number, handler in earlier.items():
            signal.signal(number, handler)
        file.write(said)
        # As a shell has it: 137 is SIGKILL.
        status = 128 - status if status < 0 else status
        # Before it listens to signals, a program ends by them.
        return (75 if asked and status == 128 + signal.SIGTERM else status), said


class Record:
    """What was done to a run, under a lock that the program inherits: a second one waits until the first has ended."""

    def __init__(self, arguments):
        self.step, self.result = arguments.step, arguments.out / "results" / arguments.run
        kind = "scenes" if self.step == "check" else "runs"
        self.path = arguments.out / "records" / kind / f"{arguments.run}.json"

    def __enter__(self):
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.lock = open(self.path.with_suffix(".lock"), "w")
        fcntl.flock(self.lock, fcntl.LOCK_EX)
        self.data = json.loads(self.path.read_text()) if self.path.exists() else {"notes": {}}
        return self

    def __exit__(self, *_):
        self.lock.close()

    def manifest(self):
        path = self.result / "manifest.json"
        return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None

    def valid(self, key):
        """The note of this step, if it was done and nobody changed the result since."""
        note = self.data["notes"].get(self.step)
        sound = self.step == "check" or self.data.get("manifest") == self.manifest() is not None
        return note if note and note["key"] == key and sound else None

    def begin(self, key):
        """Whether checkpoints, if there are any, are of this very reconstruction; from now on they are."""
        same = self.data.get("began") == key
        self.data = {"notes": {}, "began": key}
        write(self.path, self.data)
        return same

    def done(self, key, note):
        if note["status"] == 0:
            if self.step == "appearance":
                self.data["notes"].pop("report", None)
            self.data["notes"][self.step] = note
            self.data["manifest"] = self.manifest()
            write(self.path, self.data)


def program(tessuto):
    """What distinguishes one build of the program from another."""
    try:
        return subprocess.run([tessuto, "--version"], capture_output=True, check=True, text=True).stdout
    except OSError as error:
        sys.exit(f"cannot run {tessuto}: {error.strerror}; name the program with --config tessuto=FILE")
    except subprocess.CalledProcessError as error:
        print(error.stderr, file=sys.stderr)
        sys.exit(error.returncode if error.returncode > 0 else 128 - error.returncode)


def scene_key(scene):
    """Changes with the scene: its manifest, or else names, sizes and times of its files."""
    manifest = scene / "manifest.json"
    files = sorted(path for path in scene.rglob("*") if path.is_file())
    return digest(
        [
            manifest.read_text() if manifest.exists() else "",
            [[str(path.relative_to(scene)), path.stat().st_size, path.stat().st_mtime_ns] for path in files],
        ]
    )


def digest(value):
    return hashlib.sha256(json.dumps(value).encode()).hexdigest()


def write(path, value):
    """Whole or not at all."""
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_text(json.dumps(value, indent=1) + "\n")
    partial.replace(path)


if __name__ == "__main__":
    main()
