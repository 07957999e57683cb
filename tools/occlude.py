#!/usr/bin/env python3
"""Puts an opaque hand in front of the fabric of a scene: a copy of the scene in which it moves over a tenth of
the cloth.

usage: occlude.py SCENE OUT [--amodal] [--share 0.1] [--seed 0]

The masks exclude the hand, or cover the fabric behind it too with --amodal. All else is copied as it is. Needs
numpy and pillow.
"""

import argparse, shutil
from pathlib import Path

import numpy as np
from PIL import Image

# Capsules of a hand with its wrist, fingers along +y: x0 y0 x1 y1 and radius, in widths of a hand.
HAND = [
    (0, -0.15, 0, 0.2, 0.42),
    (0, -0.4, 0.05, -1.0, 0.26),
    (-0.3, 0.4, -0.42, 0.95, 0.1),
    (-0.1, 0.5, -0.13, 1.15, 0.11),
    (0.12, 0.5, 0.15, 1.1, 0.11),
    (0.32, 0.4, 0.42, 0.85, 0.09),
    (-0.35, -0.1, -0.72, 0.3, 0.12),
]


def coverage(points):
    """How deep inside the hand points are, in widths of a hand: positive inside. points [..., 2]."""
    depth = np.full(points.shape[:-1], -np.inf)
    for x0, y0, x1, y1, radius in HAND:
        a, d = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
        t = np.clip(((points - a) @ d) / max(d @ d, 1e-9), 0, 1)
        depth = np.maximum(depth, radius - np.linalg.norm(points - a - t[..., None] * d, axis=-1))
    return depth


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--amodal", action="store_true")
    parser.add_argument("--share", type=float, default=0.1)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    shutil.copytree(arguments.scene, arguments.out)
    frames, masks = (sorted((arguments.out / name).iterdir()) for name in ("rgbs", "masks"))
    first = np.asarray(Image.open(masks[0]).convert("L")) / 255.0
    rows, columns = np.nonzero(first > 0.5)
    centre, size = np.array([columns.mean(), rows.mean()]), np.sqrt((first > 0.5).sum())
    # Area of a hand of width 1, by counting.
    grid = np.stack(np.meshgrid(np.linspace(-2, 2, 400), np.linspace(-2, 2, 400)), -1)
    width = size * np.sqrt(arguments.share / ((coverage(grid) > 0).mean() * 16))
    rng = np.random.default_rng(arguments.seed)
    phase, grain = rng.uniform(0, 2 * np.pi, 3), rng.normal(0, 0.02, first.shape)
    u, v = np.meshgrid(np.arange(first.shape[1]), np.arange(first.shape[0]))
    covered = []
    for n, (frame, mask) in enumerate(zip(frames, masks)):
        t = n / max(len(frames) - 1, 1)
        # In from the left in the first fifth of the clip, then about the middle.
        roam = 0.28 * size * np.array([np.sin(2 * np.pi * 1.3 * t + phase[0]), np.sin(2 * np.pi * 0.9 * t + phase[1])])
        outside = np.array([-1.3 * size, 0.4 * size])
        entered = np.clip(t / 0.2, 0, 1)
        place = centre + (1 - entered) * outside + entered * roam
        angle = 0.5 * np.sin(2 * np.pi * 0.7 * t + phase[2]) - 0.9
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        local = (np.stack([u, v], -1) - place) @ turn / width
        depth = coverage(local)
        alpha = np.clip(depth * width + 0.5, 0, 1) if n else np.zeros_like(depth)
        shade = np.clip(0.7 + 0.6 * depth, 0, 1)[..., None] * np.array([0.80, 0.59, 0.46]) + grain[..., None]
        rgb = np.asarray(Image.open(frame).convert("RGB")) / 255.0
        rgb = rgb * (1 - alpha[..., None]) + np.clip(shade, 0, 1) * alpha[..., None]
        cloth = np.asarray(Image.open(mask).convert("L")) / 255.0
        covered.append((alpha * cloth).sum() / max(cloth.sum(), 1))
        Image.fromarray((255 * rgb + 0.5).astype(np.uint8)).save(frame)
        if not arguments.amodal:
            Image.fromarray((255 * cloth * (1 - alpha) + 0.5).astype(np.uint8)).save(mask)
    print(
        f"{arguments.out}: covers {100 * np.mean(covered):.1f} % of the cloth in the mean, at most "
        f"{100 * np.max(covered):.1f} %"
    )


if __name__ == "__main__":
    main()
