#!/usr/bin/env python3
"""Prints docs/gallery.md, for `tools/gallery.sh`: rows of name, options of synth and options of reconstruct on
standard input, the names of the scenes whose report pages are kept as arguments; scenes and results are in the
working directory.
"""

import json
import math
import struct
import sys
from pathlib import Path

TITLES = {
    "wind": (
        "In the wind",
        "Moving air presses on a hanging cloth. Stiffness, gravity and air are estimated with the motion.",
    ),
    "hands": ("In two hands", "Two hands hold the cloth near its upper corners, carry, turn and shake it."),
    "paper": ("Paper", "A sheet that bends and does not stretch."),
    "occluded": (
        "Hands in front",
        "Two hands pass in front of the cloth. The masks leave them out; the hidden part follows from the rest.",
    ),
    "blurred": ("Blurred", "Hands again, at 25 frames a second with an open shutter half of the time."),
    "filmed": (
        "As filmed",
        "A wall behind, sensor noise and H.264 compression. Masks and template come from the four corners and "
        "the size of the sheet.",
    ),
}


def motion(path):
    """Frames of flat coordinates [m] of a NumPy file of shape [N, V, 3]."""
    data = path.read_bytes()
    length = int.from_bytes(data[8:10], "little")
    header = data[10 : 10 + length].decode()
    width, code = (8, "d") if "f8" in header else (4, "f")
    frames, vertices = (int(n) for n in header.split("(")[1].split(")")[0].split(",")[:2])
    values = struct.unpack(
        f"<{frames * vertices * 3}{code}", data[10 + length : 10 + length + frames * vertices * 3 * width]
    )
    size = vertices * 3
    return [values[n * size : (n + 1) * size] for n in range(frames)]


def still(scene):
    """Mean distance [m] of the true vertices from the first frame."""
    truth = motion(scene / "gt" / "vertices.npy")
    distances = [math.dist(frame[k : k + 3], truth[0][k : k + 3]) for frame in truth for k in range(0, len(frame), 3)]
    return sum(distances) / len(distances)


def main():
    pages = sys.argv[1:]
    print("""# Gallery

Made by `tools/gallery.sh`: the video on the left, the recovered sheet from the side on the right, both slowed down.
All six clips are synthetic, so their truth is known and their errors are exact. Errors on clips by other simulators
and on a real recording are in [accuracy.md](accuracy.md).

| scene | frames | held still | vertex error | frames found, doubtful, lost |
|---|---|---|---|---|""")
    rows = [line.rstrip("\n").split("\t") for line in sys.stdin]
    for name, _, _ in rows:
        metrics = json.loads(Path("results", name, "metrics.json").read_text())
        counts = json.loads(Path("results", name, "summary.json").read_text())["verdict"]["counts"]
        error, held = metrics["mean"]["vertex"], still(Path("scenes", name))
        verdicts = ", ".join(str(counts[state]) for state in ("found", "doubtful", "lost"))
        link = TITLES[name][0].lower().replace(" ", "-")
        print(
            f"| [{TITLES[name][0]}](#{link}) | {sum(counts.values())} | {1e3 * held:.0f} mm | {1e3 * error:.1f} "
            f"mm | {verdicts} |"
        )
    print(
        """
*Held still* is the error of a program that does nothing. Two finished report pages: """
        + " and ".join(f"[{TITLES[name][0].lower()}](gallery/{name}.html)" for name in pages)
        + """.
Each is one file without links. GitHub shows its source: download it and open it in a browser."""
    )
    for name, synth, reconstruct in rows:
        title, text = TITLES[name]
        print(
            f"\n## {title}\n\n{text}\n\n![{title}: the video, and the recovered sheet from the "
            f"side](gallery/{name}.webp)\n\n```sh"
        )
        if name == "filmed":
            print("tessuto demo --clip trial                 # its README has the corners, the size and the camera")
            print('tessuto import trial/clip.mp4 scenes/filmed --outline "$CORNERS" --fx "$FX"')
            print('tessuto template scenes/filmed --flat 50x50cm --grid 21x21 --corners "$CORNERS"')
        else:
            print(f"tessuto synth scenes/{name} {synth}")
        print(" ".join(f"tessuto reconstruct scenes/{name} {reconstruct} --out results/{name}".split()) + "\n```")


main()
