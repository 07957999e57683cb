#!/usr/bin/env python3
"""Draws one frame of a result with Mitsuba 3 (same shape, maps and light; tessuto's BRDF as a plugin) and compares it
with tessuto's own picture (needs mitsuba, numpy, pillow; the llvm variant needs libLLVM, see DRJIT_LIBLLVM_PATH).

usage: compare_with_mitsuba.py SCENE_DIR RESULT_DIR FRAME [--motion gt] [--spp 256] [--out PICTURE.png] [--bounces N]

RESULT_DIR holds material/ and rerendered/ as `tessuto appearance` writes them, and motion.npy unless --motion gt.
The scene's principal point must be the picture's middle. Prints PSNR and mean difference inside the mask.
With --bounces N it leaves tessuto's picture aside (so that SCENE_DIR/gt will do as RESULT_DIR) and prints what
light that went N times from cloth to cloth changes; the principal point may then be anywhere, and fy is taken to be fx.
"""

import argparse
import json
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("llvm_ad_rgb")
FLIP = np.array([1.0, -1.0, -1.0])  # camera frame (y down, z forward) -> Mitsuba's world (y up, z backward)


class Cloth(mi.BSDF):
    """Lambert T_D (1 - T_M)/pi + GGX (correlated Smith, Schlick), two-sided, light from behind the triangle blocked."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.base, self.rough, self.metal = (props[k] for k in ("base", "rough", "metal"))
        flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [flags]
        self.m_flags = flags

    def sample(self, ctx, si, sample1, sample2, active=True):
        side = dr.sign(mi.Frame3f.cos_theta(si.wi))
        wo = mi.warp.square_to_cosine_hemisphere(sample2)
        wo.z *= side
        bs = mi.BSDFSample3f()
        bs.wo, bs.pdf, bs.eta = wo, dr.abs(wo.z) / dr.pi, 1.0
        bs.sampled_type, bs.sampled_component = mi.UInt32(+mi.BSDFFlags.DiffuseReflection), 0
        return bs, self.eval(ctx, si, wo, active) / dr.maximum(bs.pdf, 1e-9)

    def pdf(self, ctx, si, wo, active=True):
        return dr.select(si.wi.z * wo.z > 0, dr.abs(wo.z) / dr.pi, 0)

    def eval(self, ctx, si, wo, active=True):
        base, r, m = self.base.eval(si), self.rough.eval_1(si), self.metal.eval_1(si)
        nv, nl = dr.maximum(dr.abs(si.wi.z), 1e-3), dr.maximum(dr.abs(wo.z), 1e-6)
        h = dr.normalize(si.wi + wo)
        a2 = r**4
        d = a2 / (dr.pi * dr.square(dr.square(h.z) * (a2 - 1) + 1))
        vis = 0.5 / (nl * dr.sqrt(a2 + (1 - a2) * nv * nv) + nv * dr.sqrt(a2 + (1 - a2) * nl * nl))
        f0 = 0.04 * (1 - m) + base * m
        f = f0 + (1 - f0) * (1 - dr.abs(dr.dot(h, wo))) ** 5
        front = (si.wi.z * wo.z > 0) & (dr.dot(si.n, si.to_world(wo)) * dr.dot(si.n, si.to_world(si.wi)) > 0)
        return dr.select(front & active, (base * (1 - m) / dr.pi + f * d * vis) * nl, 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)


mi.register_bsdf("cloth", Cloth)


def mesh_of(template, shape, path):
    """Writes the frame as OBJ with area-weighted vertex normals."""
    uvs, faces = [], []
    for line in open(template):
        t = line.split()
        if t and t[0] == "vt":
            uvs.append(t[1:3])
        elif t and t[0] == "f":
            c = [[int(i) for i in v.split("/")[:2]] for v in t[1:]]
            faces += [[c[0], c[k], c[k + 1]] for k in range(1, len(c) - 1)]
    p = shape * FLIP
    n = np.zeros_like(p)
    for f in faces:
        a, b, c = (p[v[0] - 1] for v in f)
        for v in f:
            n[v[0] - 1] += np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    with open(path, "w") as o:
        o.writelines(f"v {x} {y} {z}\n" for x, y, z in p)
        o.writelines(f"vn {x} {y} {z}\n" for x, y, z in n)
        o.writelines(f"vt {u} {v}\n" for u, v in uvs)
        o.writelines("f " + " ".join(f"{v}/{t}/{v}" for v, t in f) + "\n" for f in faces)


def encode(linear):
    return np.clip(
        np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055), 0, 1
    )


def bounced(description, camera, spp, bounces):
    """Draws with no and with so many bounces, same random numbers, and prints how they differ."""
    w, h, sensor = camera["width"], camera["height"], description["sensor"]
    sensor["principal_point_offset_x"] = (camera["cx"] - (w - 1) / 2) / w
    sensor["principal_point_offset_y"] = (camera["cy"] - (h - 1) / 2) / h
    pictures = []
    for depth in (2, 2 + bounces):
        description["integrator"] = {"type": "path", "max_depth": depth, "rr_depth": 100, "hide_emitters": True}
        pictures.append(np.array(mi.render(mi.load_dict(description), spp=spp, seed=1)))
    cloth = pictures[0].max(-1) > 0
    direct, more = (p[cloth] for p in pictures)
    factor = (direct * more).sum(0) / (direct * direct).sum(0)
    psnr = lambda a, b: -10 * np.log10(np.mean((encode(a) - encode(b)) ** 2))
    k = 16  # Means of blocks: single pixels are noisy.
    block = lambda x: x[: h // k * k, : w // k * k].reshape(h // k, k, w // k, k, -1).sum((1, 3)).mean(-1)
    lit = block(pictures[0])
    ratio = (block(pictures[1]) / np.maximum(lit, 1e-9))[lit > 0.05 * lit.max()]
    print(
        f"{bounces} bounces against none: {psnr(direct, more):.2f} dB, after the best factor "
        f"{psnr(direct * factor, more):.2f} dB; brighter by {100 * (ratio.mean() - 1):.1f} % in the mean, "
        f"{100 * (np.quantile(ratio, 0.99) - 1):.1f} % in the brightest hundredth of {k}x{k} blocks"
    )


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ap.add_argument("scene", type=Path)
    ap.add_argument("result", type=Path)
    ap.add_argument("frame", type=int)
    ap.add_argument("--motion", choices=["result", "gt"], default="result")
    ap.add_argument("--spp", type=int, default=256)
    ap.add_argument("--out", type=Path)
    ap.add_argument("--bounces", type=int)
    a = ap.parse_args()
    camera = json.load(open(a.scene / "scene.json"))
    w, h = camera["width"], camera["height"]
    motion = np.load(a.scene / "gt/vertices.npy" if a.motion == "gt" else a.result / "motion.npy")
    obj = Path("/tmp") / f"mitsuba_frame_{a.frame}.obj"
    mesh_of(a.scene / "template.obj", motion[a.frame].astype(float), obj)
    light = np.array(
        mi.Bitmap(str(a.result / "material/environment.exr")).convert(mi.Bitmap.PixelFormat.RGB), np.float32
    )
    light = np.roll(light, light.shape[1] // 2, axis=1)  # Mitsuba's left border is where our middle is

    def texture(name, raw):
        return {"type": "bitmap", "filename": str(a.result / f"material/{name}.png"), "raw": raw, "wrap_mode": "clamp"}

    cloth = {
        "type": "cloth",
        "base": texture("diffuse", False),
        "rough": texture("roughness", True),
        "metal": texture("metallic", True),
    }
    description = {
        "type": "scene",
        "integrator": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 1, "hide_emitters": True},
        "shape": {"type": "obj", "filename": str(obj), "bsdf": cloth},
        "light": {"type": "envmap", "bitmap": mi.Bitmap(light)},
        "sensor": {
            "type": "perspective",
            "fov_axis": "x",
            "fov": float(np.degrees(2 * np.arctan(w / 2 / camera["fx"]))),
            "to_world": mi.ScalarTransform4f().look_at([0, 0, 0], [0, 0, -1], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": w, "height": h, "rfilter": {"type": "box"}, "pixel_format": "rgb"},
        },
    }
    if a.bounces:
        return bounced(description, camera, a.spp, a.bounces)
    scene = mi.load_dict(description)
    linear = np.array(mi.render(scene, spp=a.spp, seed=1))
    srgb = encode(linear)
    name = f"{a.frame:03}.png"
    own = np.asarray(Image.open(a.result / f"rerendered/rgb_{name}").convert("RGB"), float) / 255
    mask = np.asarray(Image.open(a.scene / f"masks/mask_{name}").convert("L")) > 127
    # Two pixels from the outline on: both sides there are blends of cloth and background.
    inner = mask.copy()
    for axis in (0, 1):
        for step in (-2, -1, 1, 2):
            inner &= np.roll(mask, step, axis)
    difference = (srgb - own)[inner]
    blocks = (srgb - own) * inner[..., None]
    k = 16
    cut = lambda x: x[: h // k * k, : w // k * k].reshape(h // k, k, w // k, k, -1).sum((1, 3))
    count = cut(inner[..., None].astype(float))
    full = count[..., 0] > k * k * 0.9
    means = (cut(blocks) / np.maximum(count, 1))[full]
    print(
        f"PSNR {-10 * np.log10(np.mean(difference**2)):.2f} dB, mean difference {difference.mean():+.5f}, "
        f"means of {k}x{k} blocks: rms {np.sqrt(np.mean(means**2)):.5f}, largest {np.abs(means).max():.5f}"
    )
    if a.out:
        grey = np.clip(0.5 + 4 * (srgb - own) * inner[..., None], 0, 1)
        Image.fromarray((np.hstack([srgb, own, grey]) * 255).astype(np.uint8)).save(a.out)


main()
