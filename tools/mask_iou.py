#!/usr/bin/env python3
"""Overlap of masks with true ones: intersection over union per frame, mean and worst; pip install numpy pillow.

    tools/mask_iou.py SCENE/masks TRUE/masks [--soft] [--each]

A pixel is fabric from one half on; with --soft coverages count as they are (sum of minima over sum of maxima).
The outline column is the mean distance in pixels that this overlap means: (1 - IoU) * area / outline length.
"""

import argparse
import pathlib
import re
import sys

import numpy as np
from PIL import Image


def read(path):
    image = np.asarray(Image.open(path).convert("L"), dtype=np.float64) / 255.0
    return image


def numbered(folder):
    files = {}
    for path in sorted(pathlib.Path(folder).iterdir()):
        number = re.search(r"(\d+)\.(png|jpe?g)$", path.name)
        if number:
            files[int(number.group(1))] = path
    return files


def overlap(a, b, soft):
    if not soft:
        a, b = a >= 0.5, b >= 0.5
    union = np.maximum(a, b).sum()
    return np.minimum(a, b).sum() / union if union else 1.0


def outline_length(mask):
    inside = mask >= 0.5
    return (inside[1:] != inside[:-1]).sum() + (inside[:, 1:] != inside[:, :-1]).sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("masks")
    parser.add_argument("truth")
    parser.add_argument("--soft", action="store_true")
    parser.add_argument("--each", action="store_true", help="print every frame")
    arguments = parser.parse_args()
    found, truth = numbered(arguments.masks), numbered(arguments.truth)
    missing = sorted(set(truth) - set(found))
    if missing:
        sys.exit(f"no mask for frames {missing}")
    values, off = [], []
    for number, path in truth.items():
        true = read(path)
        value = overlap(read(found[number]), true, arguments.soft)
        values.append(value)
        off.append((1 - value) * (true >= 0.5).sum() / max(outline_length(true), 1))
        if arguments.each:
            print(f"frame {number}: {value:.4f}")
    worst = int(np.argmin(values))
    print(
        f"IoU mean {np.mean(values):.4f}, worst {values[worst]:.4f} (frame {list(truth)[worst]}), "
        f"outline off by {np.mean(off):.2f} px, {len(values)} frames"
    )


if __name__ == "__main__":
    main()
