#!/usr/bin/env python3
"""Check exported files with the programs they are meant for.

usage: check_exports.py RESULT [--tessuto PROGRAM] [--rerun-python PYTHON]

Exports RESULT (a folder of `tessuto reconstruct`) to every format into a temporary folder and checks
  glb   Khronos validator (no errors, no warnings), import in Blender: vertices of every frame; the script for
        Blender: keys on whole frames; where the other side has a colour of its own, both surfaces: vertices, winding,
        normals and material of each
  usd   usd-core: loads, compliance checker, vertices, frame rate, projection by the exported camera; import in Blender
  obj, ply, pc2, npz   vertices of every frame; pc2 in Blender too
  rrd   see check_recording.py
against RESULT/motion.npy. Needs `pip install numpy bpy==5.0.1 usd-core` (Python 3.11) and, where it is run,
`npm install gltf-validator`; check_recording.py needs another Python environment, named by --rerun-python, and is left
out without. Exit status 0: all passed.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TOLERANCE = 1e-5  # metres
failures = []


def report(what, passed, detail=""):
    print(f"{'ok  ' if passed else 'FAIL'} {what}{'  ' + detail if detail else ''}", flush=True)
    if not passed:
        failures.append(what)


def distance(what, found, expected):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    if found.shape != expected.shape:
        return report(what, False, f"shape {found.shape}, expected {expected.shape}")
    error = np.abs(found - expected).max()
    report(what, error <= TOLERANCE, f"largest error {error:.1e} m")


def check_npz(folder, name, motion):
    data = np.load(folder / f"{name}.npz")
    report("npz: motion, bit for bit", np.array_equal(data["motion"], motion))
    report("npz: keys", True, " ".join(f"{k}{list(data[k].shape)}" for k in data))


def check_pc2(folder, name, motion, y_up):
    raw = (folder / f"{name}.pc2").read_bytes()
    version, vertices = np.frombuffer(raw, "<i4", 2, 12)
    samples = np.frombuffer(raw, "<i4", 1, 28)[0]
    report("pc2: header", raw[:12] == b"POINTCACHE2\0" and (version, vertices, samples) == (1, *motion.shape[1::-1]))
    distance("pc2: vertices", np.frombuffer(raw, "<f4", offset=32).reshape(motion.shape), y_up)


def check_sequences(folder, name, motion, y_up):
    def read(path):
        return [[float(w) for w in line.split()[1:]] for line in path.read_text().splitlines() if line.startswith("v ")]

    distance("obj: vertices of every frame", [read(p) for p in sorted((folder / f"{name}_obj").glob("*.obj"))], y_up)
    frames = []
    for path in sorted((folder / f"{name}_ply").glob("*.ply")):
        raw = path.read_bytes()
        end = raw.index(b"end_header\n") + 11
        width = raw[:end].count(b"property float")
        frames.append(np.frombuffer(raw, "<f4", motion.shape[1] * width, end).reshape(-1, width)[:, :3])
    distance("ply: vertices of every frame", frames, y_up)


def check_validator(folder, name):
    code = """const v = require('gltf-validator'), fs = require('fs');
        v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1]))).then(r => console.log(JSON.stringify(r)))"""
    run = subprocess.run(["node", "-e", code, folder / f"{name}.glb"], capture_output=True, text=True)
    if run.returncode:
        return report(
            "glb: validator runs", False, run.stderr.strip().splitlines()[-1] + " (npm install gltf-validator)"
        )
    issues = json.loads(run.stdout)["issues"]
    counts = {k: issues[k] for k in ("numErrors", "numWarnings", "numInfos")}
    report("glb: Khronos validator", not counts["numErrors"] and not counts["numWarnings"], str(counts))
    for message in {(m["severity"], m["code"], m["message"]) for m in issues["messages"]}:
        print("     ", *message)


def read_glb(path):
    """The JSON of a binary glTF, and a function that reads an accessor of floats or whole numbers."""
    raw = path.read_bytes()
    length = int.from_bytes(raw[12:16], "little")
    gltf, binary = json.loads(raw[20 : 20 + length]), raw[28 + length :]

    def accessor(index):
        entry = gltf["accessors"][index]
        view = gltf["bufferViews"][entry["bufferView"]]
        kind = {5126: "<f4", 5125: "<u4", 5123: "<u2", 5121: "u1"}[entry["componentType"]]
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}[entry["type"]]
        start = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        values = np.frombuffer(binary, kind, entry["count"] * width, start)
        return values.reshape(-1, width).squeeze() if width == 1 else values.reshape(-1, width)

    return gltf, accessor


def check_sides(folder, name, motion, y_up):
    """The surfaces of the GLB: one that is seen from both sides, or print and back, each seen from its own."""
    gltf, accessor = read_glb(folder / f"{name}.glb")
    meshes, materials = gltf["meshes"], gltf["materials"]
    if len(meshes[0]["primitives"]) == 1:
        return report("glb: one surface, seen from both sides", all(m.get("doubleSided") for m in materials))

    def frames(side, what):
        """Of every frame: those of the first mesh, its targets, then those of the meshes of later frames."""
        first = meshes[0]["primitives"][side]
        out = [accessor(first["attributes"][what])]
        for mesh in meshes:
            primitive = mesh["primitives"][side]
            base = accessor(primitive["attributes"][what])
            out += [base + accessor(target[what]) for target in primitive["targets"]]
        return np.array(out, float)

    triangles = [accessor(meshes[0]["primitives"][side]["indices"]).reshape(-1, 3) for side in (0, 1)]
    # Every triangle once, beginning with its first vertex; the back's the other way round.
    first = [np.array([np.roll(t, -int(t.argmin())) for t in side]) for side in (triangles[0], triangles[1][:, ::-1])]
    same = first[0].shape == first[1].shape and np.array_equal(*[side[np.lexsort(side.T)] for side in first])
    report("glb: the back has the print's triangles, the other way round", same, f"{len(triangles[0])} triangles")
    normals = [frames(side, "NORMAL") for side in (0, 1)]
    for side, what in enumerate(("print", "back")):
        positions = frames(side, "POSITION")
        distance(f"glb: vertices of every frame, {what}", positions, y_up)
        a, b, c = (positions[:, triangles[side][:, k]] for k in range(3))
        facing = np.cross(b - a, c - a)
        if side == 0:
            # The camera is at the origin; in the first frame it sees more of the print.
            seen = -(facing[0] * a[0]).sum(-1)
            report("glb: the first frame shows the print", seen.sum() > 0, f"{(seen > 0).mean():.0%} of the triangles")
        # Normals of vertices are means, which turn away from few triangles of a sharp fold.
        agree = ((normals[side][:, triangles[side]].sum(2) * facing).sum(-1) > 0).mean()
        report(f"glb: normals on the side of the {what}", agree > 0.99, f"{agree:.2%} of the triangles")
    distance("glb: normals of the back are those of the print, turned about", normals[1], -normals[0])
    used = [materials[meshes[0]["primitives"][side]["material"]] for side in (0, 1)]
    single = not any(material.get("doubleSided") for material in used)
    look = [material["pbrMetallicRoughness"] for material in used]
    coloured = "baseColorTexture" in look[0] and "baseColorTexture" not in look[1]
    told = json.loads((Path(args.result) / "parameters.json").read_text()).get("back", "")
    encoded = (
        np.array([int(told[k : k + 2], 16) for k in (1, 3, 5)]) / 255 if told.startswith("#") else np.full(3, np.nan)
    )
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    error = np.abs(np.array(look[1].get("baseColorFactor", [np.inf] * 4)[:3]) - linear).max()
    report("glb: print and back have materials of their own", single and coloured)
    report("glb: the colour of the back", error < 5e-3, f"{told}, largest error {error:.1e}")


def check_usd(folder, name, motion, y_up):
    from pxr import Gf, Usd, UsdGeom, UsdShade, UsdUtils

    path = str(folder / f"{name}.usda")
    stage = Usd.Stage.Open(path)
    # The compliance checker: UsdUtils.ComplianceChecker up to 26.05, the validation framework since.
    if hasattr(UsdUtils, "ComplianceChecker"):
        checker = UsdUtils.ComplianceChecker(arkit=False)
        checker.CheckCompliance(path)
        problems = checker.GetErrors() + checker.GetFailedChecks() + checker.GetWarnings()
    else:
        from pxr import UsdValidation

        validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
        problems = [e.GetMessage() for e in UsdValidation.ValidationContext(validators).Validate(stage)]
    report("usd: compliance checker", not problems, "; ".join(problems))
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath(f"/{name}/Fabric"))
    points = [mesh.GetPointsAttr().Get(n) for n in range(len(motion))]
    distance("usd: vertices of every frame", points, y_up)
    back = UsdGeom.Mesh(stage.GetPrimAtPath(f"/{name}/Back"))
    if back:
        distance("usd: vertices of the back", [back.GetPointsAttr().Get(n) for n in range(len(motion))], y_up)
        sides = [(side.GetOrientationAttr().Get(), side.GetDoubleSidedAttr().Get()) for side in (mesh, back)]
        bound = [
            UsdShade.MaterialBindingAPI(side.GetPrim()).ComputeBoundMaterial()[0].GetPath() for side in (mesh, back)
        ]
        apart = sides[0][0] != sides[1][0] and not sides[0][1] and not sides[1][1] and bound[0] != bound[1]
        report("usd: print and back, each seen from its own side", apart, f"{sides} {bound}")
    normals = np.array([mesh.GetNormalsAttr().Get(n) for n in range(len(motion))])
    report("usd: unit normals", np.abs(np.linalg.norm(normals, axis=-1) - 1).max() < 1e-5)
    report("usd: upAxis, unit", UsdGeom.GetStageUpAxis(stage) == "Y" and UsdGeom.GetStageMetersPerUnit(stage) == 1.0)
    parameters = json.loads((Path(args.result) / "parameters.json").read_text())
    fps = parameters["frame_rate"]["value"]
    report(
        "usd: frame rate",
        stage.GetTimeCodesPerSecond() == fps and stage.GetEndTimeCode() == len(motion) - 1,
        f"{fps} 1/s",
    )
    material, _ = UsdShade.MaterialBindingAPI(mesh.GetPrim()).ComputeBoundMaterial()
    textures = (
        [s for s in Usd.PrimRange(material.GetPrim()) if UsdShade.Shader(s).GetIdAttr().Get() == "UsdUVTexture"]
        if material
        else []
    )
    resolved = [UsdShade.Shader(t).GetInput("file").Get().resolvedPath for t in textures]
    report("usd: textures resolve", bool(resolved) and all(resolved), " ".join(Path(r).name for r in resolved))
    camera = parameters.get("camera")
    if camera:
        frustum = UsdGeom.Camera(stage.GetPrimAtPath(f"/{name}/Camera")).GetCamera(0).frustum
        ndc = np.array([frustum.ComputeViewMatrix().Transform(Gf.Vec3d(*map(float, p))) for p in points[0]])
        ndc = np.array([frustum.ComputeProjectionMatrix().Transform(Gf.Vec3d(*p)) for p in ndc])
        w, h = camera["width"], camera["height"]
        pixel = np.stack([(ndc[:, 0] + 1) / 2 * w - 0.5, (1 - ndc[:, 1]) / 2 * h - 0.5], 1)
        x, y, z = motion[0].T.astype(float)
        expected = np.stack([camera["fx"] * x / z + camera["cx"], camera["fy"] * y / z + camera["cy"]], 1)
        error = np.abs(pixel - expected).max()
        report("usd: projection by the camera", error < 1e-2, f"largest error {error:.1e} px")


def check_blender(folder, name, motion, fps):
    import bpy

    z_up = np.stack([motion[..., 0], motion[..., 2], -motion[..., 1]], -1)
    for kind in ("glb", "usda"):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        # The importer of glTF multiplies seconds by fps times fps_base, see the script for Blender.
        scene.render.fps, scene.render.fps_base = round(fps), fps / round(fps) if kind == "glb" else round(fps) / fps
        start = time.time()
        if kind == "glb":
            bpy.ops.import_scene.gltf(filepath=str(folder / f"{name}.glb"))
        else:
            bpy.ops.wm.usd_import(filepath=str(folder / f"{name}.usda"))
        seconds = time.time() - start
        meshes = [o for o in scene.objects if o.type == "MESH"]
        # glTF times start at frame 0 here: keys are at time · fps.
        frames = []
        for n in range(len(motion)):
            scene.frame_set(n)
            graph = bpy.context.evaluated_depsgraph_get()
            visible = [o for o in meshes if o.evaluated_get(graph).matrix_world.determinant() > 1e-6]
            surfaces = []
            # Print and back are two parts of a mesh, or two meshes.
            for obj in (o.evaluated_get(graph) for o in visible):
                mesh = obj.to_mesh()
                values = np.empty(3 * len(mesh.vertices))
                mesh.vertices.foreach_get("co", values)
                world = np.array(obj.matrix_world)
                surfaces.append(values.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
                obj.to_mesh_clear()
            frames.append(np.concatenate(surfaces))
        sides = max(len(frames[0]) // motion.shape[1], 1)
        what = f"{kind}: vertices of every frame in Blender {bpy.app.version_string}"
        distance(what + (f", {sides} surfaces" if sides > 1 else ""), frames, np.concatenate([z_up] * sides, 1))
        arrays = np.load(folder / f"{name}.npz")
        if len(arrays["uv"]) == motion.shape[1] and np.array_equal(arrays["face_uvs"], arrays["face_vertices"]):
            mesh = meshes[0].data
            found, corner = np.empty(2 * len(mesh.loops)), np.empty(len(mesh.loops), int)
            mesh.uv_layers[0].data.foreach_get("uv", found)
            mesh.loops.foreach_get("vertex_index", corner)
            # The back, whose vertices come after those of the print, has no uv.
            printed = corner < motion.shape[1]
            error = np.abs(found.reshape(-1, 2)[printed] - arrays["uv"][corner[printed]]).max()
            report(f"{kind}: uv in Blender, v = 0 below", error < 1e-6, f"largest error {error:.1e}")
        images = [i.name for i in bpy.data.images if i.size[0]]
        report(
            f"{kind}: material and pictures in Blender",
            bool(images) and bool(meshes[0].material_slots),
            f"{images}, import {seconds:.2f} s",
        )
        cameras = [o for o in scene.objects if o.type == "CAMERA"]
        report(f"{kind}: camera in Blender", bool(cameras))


def check_script(folder, name, motion, fps):
    """The script for Blender, as Blender runs it: keys on whole frames, then the video's own rate."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    path = folder / f"{name}_blender.py"
    exec(compile(path.read_text(), str(path), "exec"), {"__file__": str(path), "__name__": "__main__"})
    strips = [s for action in bpy.data.actions for layer in action.layers for s in layer.strips]
    curves = [c for strip in strips for bag in strip.channelbags for c in bag.fcurves]
    keys = sorted({key.co[0] for curve in curves for key in curve.keyframe_points})
    report("script: keys on the frames", keys == list(range(len(motion))), f"{len(keys)} keys of {len(motion)} frames")
    render = bpy.context.scene.render
    found = render.fps / render.fps_base
    report("script: frame rate", abs(found / fps - 1) < 1e-6, f"{found} 1/s of {fps}")


def check_cache(folder, name, motion):
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=str(folder / f"{name}_pc2.obj"))
    cloth = bpy.context.object
    cache = cloth.modifiers.new("motion", "MESH_CACHE")
    cache.cache_format, cache.filepath = "PC2", str(folder / f"{name}.pc2")
    frames = []
    for n in range(len(motion)):
        bpy.context.scene.frame_set(n)
        obj = cloth.evaluated_get(bpy.context.evaluated_depsgraph_get())
        values = np.array([obj.matrix_world @ v.co for v in obj.to_mesh().vertices])
        frames.append(values)
        obj.to_mesh_clear()
    z_up = np.stack([motion[..., 0], motion[..., 2], -motion[..., 1]], -1)
    distance(f"pc2: vertices of every frame in Blender {bpy.app.version_string}", frames, z_up)


parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("result")
parser.add_argument("--tessuto", default=Path(__file__).parent / "../target/release/tessuto")
parser.add_argument("--rerun-python")
args = parser.parse_args()
motion = np.load(Path(args.result) / "motion.npy")
y_up = motion * [1, -1, -1]
with tempfile.TemporaryDirectory() as temporary:
    folder = Path(temporary)
    start = time.time()
    # A build without the feature has no rrd.
    formats = "glb,usd,obj,ply,pc2,npz" + (",rrd" if args.rerun_python else "")
    subprocess.run(
        [args.tessuto, "export", args.result, "--to", formats, "--out", folder],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    report(
        "export to all formats",
        True,
        f"{time.time() - start:.2f} s, {sum(p.stat().st_size for p in folder.rglob('*') if p.is_file()) / 1e6:.1f} MB",
    )
    name = next(folder.glob("*.glb")).stem
    check_npz(folder, name, motion)
    check_pc2(folder, name, motion, y_up)
    check_sequences(folder, name, motion, y_up)
    check_sides(folder, name, motion, y_up)
    check_validator(folder, name)
    check_usd(folder, name, motion, y_up)
    fps = json.loads((Path(args.result) / "parameters.json").read_text())["frame_rate"]["value"]
    check_blender(folder, name, motion, fps)
    check_script(folder, name, motion, fps)
    check_cache(folder, name, motion)
    if args.rerun_python:
        check = Path(__file__).with_name("check_recording.py")
        done = subprocess.run([args.rerun_python, check, folder / f"{name}.rrd", args.result])
        report("rrd: check_recording.py", done.returncode == 0)
print(f"{len(failures)} failures" if failures else "all passed")
sys.exit(bool(failures))
