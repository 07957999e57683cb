#!/usr/bin/env python3
"""Check what simulators make of the fabric in exported files.

usage: check_physics.py RESULT [--tessuto PROGRAM]

Exports RESULT (a folder of `tessuto reconstruct`, with estimated physics) and lets a strip of its fabric hang over an
edge, in MuJoCo and in Newton, both on the CPU, with the numbers that these read from the files. The overhang at which
the line from the edge to the end slopes by 41.5 degrees must be that of `tessuto fabric` within a tenth. Needs
`pip install numpy mujoco "newton[importers]"`, MuJoCo 4.0 or later, Newton 1.8 or later; what is missing is left out,
with NOT TESTED. Exit status 0: nothing failed.
"""

import argparse
import math
import re
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

GRAVITY, SLOPE, WITHIN = 9.81, 41.5, 0.1
failures = []


def report(what, passed, detail=""):
    print(f"{'ok  ' if passed else 'FAIL'} {what}{'  ' + detail if detail else ''}", flush=True)
    if not passed:
        failures.append(what)


def not_tested(what, why):
    print(f"NOT TESTED {what}  {why}", flush=True)


def close(what, found, expected, within=1e-4):
    report(what, abs(found / expected - 1) <= within, f"{found:.6g}, expected {expected:.6g}")


def overhang(slope_of, guess, rounds):
    """The length whose end slopes by 41.5 degrees: drop over reach grows nearly as its cube."""
    length = guess
    for _ in range(rounds):
        slope = slope_of(length)
        print(f"     {1e3 * length:.1f} mm: {slope:.2f} degrees", flush=True)
        length *= (math.tan(math.radians(SLOPE)) / math.tan(math.radians(slope))) ** (1 / 2.5)
    return length


def strip(length, cells, rows, held):
    """Vertices (x, y) and triangles of a strip, split as exported quads are. The hinges at the last held column stand
    for half a cell on either side: there the strip begins, at x = 0."""
    import numpy as np

    h, columns = length / (cells + 0.5), cells + held
    places = [((c - held + 1.5) * h, (r - (rows - 1) / 2) * h) for r in range(rows) for c in range(columns)]
    at = lambda c, r: r * columns + c
    triangles = []
    for r in range(rows - 1):
        for c in range(columns - 1):
            a, b, d, e = at(c, r), at(c + 1, r), at(c + 1, r + 1), at(c, r + 1)
            triangles += [(a, b, d), (a, d, e)]
    masses = np.zeros(len(places))
    for triangle in triangles:
        masses[list(triangle)] += h * h / 6
    clamped = [at(c, r) for r in range(rows) for c in range(held)]
    ends = [at(columns - 1, r) for r in range(rows)]
    return np.array(places), triangles, masses, clamped, ends


def slope(ends):
    return math.degrees(math.atan2(-ends[2], ends[0]))


# MuJoCo


def mujoco_slope(length, young, thickness, density, seconds=6.0, cells=30, rows=5, held=3):
    import mujoco
    import numpy as np

    places, triangles, areas, clamped, ends = strip(length, cells, rows, held)
    bodies = ""
    for v, (x, y) in enumerate(places):
        joints = "".join(f'<joint type="slide" axis="{a}"/>' for a in ("1 0 0", "0 1 0", "0 0 1"))
        joints = "" if v in clamped else joints
        inertia = f'<inertial pos="0 0 0" mass="{density * areas[v]:.6e}" diaginertia="1e-9 1e-9 1e-9"/>'
        bodies += f'<body name="v{v}" pos="{x:.9f} {y:.9f} 0">{inertia if joints else ""}{joints}</body>'
    text = f"""<mujoco><option timestep="0.004" integrator="discrete" solver="Newton" tolerance="1e-9"
        gravity="0 0 {-GRAVITY}"/><worldbody>{bodies}</worldbody><deformable>
        <flex name="strip" dim="2" radius="0.0002" body="{" ".join(f"v{v}" for v in range(len(places)))}"
        element="{" ".join(str(v) for t in triangles for v in t)}"><contact selfcollide="none"/>
        <elasticity young="{young}" poisson="0" thickness="{thickness}" elastic2d="both" damping="0.05"/>
        </flex></deformable></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for _ in range(int(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
    if np.abs(data.qvel).max() > 1e-3:
        print(f"     not at rest: {np.abs(data.qvel).max():.1e} m/s")
    return slope(data.flexvert_xpos.reshape(-1, 3)[ends].mean(axis=0))


def check_mujoco(folder, name, expected):
    try:
        import mujoco
        import numpy as np
    except ImportError as error:
        return not_tested("MuJoCo", str(error))
    if int(mujoco.__version__.split(".")[0]) < 4:
        return not_tested("MuJoCo", f"version {mujoco.__version__} has other elastic constants")
    path = folder / f"{name}_mujoco.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    usd = (folder / f"{name}.usda").read_text()
    points = re.search(r"def Mesh \"Sheet\".*? points = \[(.*?)\]", usd, re.S).group(1)
    points = np.array([float(w) for w in re.findall(r"[-+.\de]+", points)]).reshape(-1, 3)
    shown = data.flexvert_xpos.reshape(-1, 3)
    # x right, z up, y ahead.
    off = np.abs(shown - points[:, [0, 2, 1]] * [1, -1, 1]).max()
    report("MuJoCo: the first frame", off < 1e-6, f"largest error {off:.1e} m")
    close("MuJoCo: weight", model.body_mass.sum(), float(re.search(r"physics:masses = \[(.*?)\]", usd).group(1)))
    held = [int(v) for v in re.findall(r'joint1="v(\d+)x"', path.read_text())]
    before = shown.copy()
    for _ in range(int(0.5 / model.opt.timestep)):
        mujoco.mj_step(model, data)
    moved = data.flexvert_xpos.reshape(-1, 3)
    warned = sum(w.number for w in data.warning)
    report("MuJoCo: half a second without a warning", warned == 0 and np.isfinite(moved).all(), f"{warned} warnings")
    if held:
        off = np.abs(moved - before)[held].max()
        report("MuJoCo: what is held stays", off < 1e-3, f"{len(held)} vertices, largest way {1e3 * off:.2f} mm")
    young, thickness = (float(re.search(rf'{k}="(.*?)"', path.read_text()).group(1)) for k in ("young", "thickness"))
    density = float(re.search(r"tessuto:areaDensity = (\S+)", usd).group(1))
    found = overhang(lambda length: mujoco_slope(length, young, thickness, density), expected, 3)
    report("MuJoCo: overhang", abs(found / expected - 1) < WITHIN, compared(found, expected))


def compared(found, expected):
    return f"{1e3 * found:.1f} mm, tessuto {1e3 * expected:.1f} mm: {100 * (found / expected - 1):+.1f} %"


# Newton


def newton_slope(length, stretch, bend, density, per_length, seconds=0.8, cells=16, rows=4, held=3):
    """`per_length`: divide the bending stiffness by the length across every hinge, as its unit N·m asks for."""
    import newton
    import numpy as np
    import warp as wp

    places, triangles, areas, clamped, ends = strip(length, cells, rows, held)
    builder = newton.ModelBuilder(up_axis=newton.Axis.Z)
    vertices = [wp.vec3(float(x), float(y), 0.0) for x, y in places]
    builder.add_cloth_mesh(
        pos=wp.vec3(0.0, 0.0, 0.0), rot=wp.quat_identity(), scale=1.0, vel=wp.vec3(0.0, 0.0, 0.0), vertices=vertices,
        indices=[v for t in triangles for v in t], density=density, tri_ke=stretch, tri_ka=0.0, tri_kd=0.0,
        edge_ke=bend, edge_kd=0.0,
    )  # fmt: skip
    if per_length:
        xy = np.column_stack([places, np.zeros(len(places))])
        for k, (o0, o1, a, b) in enumerate(builder.edge_indices):
            if min(o0, o1) >= 0:
                edge = xy[b] - xy[a]
                area = sum(0.5 * np.linalg.norm(np.cross(edge, xy[o] - xy[a])) for o in (o0, o1))
                builder.edge_bending_properties[k] = (bend * np.linalg.norm(edge) / area, 0.0)
    for v in clamped:
        builder.particle_mass[v] = 0.0
        builder.particle_flags[v] = int(builder.particle_flags[v]) & ~int(newton.ParticleFlags.ACTIVE)
    builder.color(include_bending=True)
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverVBD(model, iterations=10, particle_enable_self_contact=False)
    now, then, control, step, friction = model.state(), model.state(), model.control(), 2e-4, 15.0
    for _ in range(int(seconds / step)):
        now.clear_forces()
        solver.step(now, then, control, None, step)
        now, then = then, now
        # The arrays of the CPU are seen in place.
        velocities = now.particle_qd.numpy()
        velocities *= np.float32(1 - friction * step)
    return slope(now.particle_q.numpy()[ends].mean(axis=0))


def check_newton(folder, name, expected):
    try:
        import newton
        import numpy as np
        import warp as wp
        from pxr import Usd  # noqa: F401
    except ImportError as error:
        return not_tested("Newton", str(error))
    wp.config.quiet = True
    text = (folder / f"{name}.usda").read_text()
    builder = newton.ModelBuilder(up_axis=newton.Axis.Y)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            found = builder.add_usd(str(folder / f"{name}.usda"), return_deformable_results=True)
        except ImportError as error:
            return not_tested("Newton", str(error))
    for warning in {str(w.message) for w in said}:
        print("     Newton says:", warning)
    path = f"/{name}/Simulation/Sheet"
    report("Newton: the sheet is a cloth", list(found["path_cloth_map"]) == [path], str(list(found["path_cloth_map"])))
    own = found["path_cloth_attrs"][path]
    stretch, shear, bend = (own["material"][f"surface{k}Stiffness"] for k in ("Stretch", "Shear", "Bend"))
    widths = {k: float(re.search(rf"physics:{k} = (\S+)", text).group(1)) for k in own["material"]}
    for key, value in widths.items():
        close(f"Newton: {key}", own["material"][key], value)
    weight = float(re.search(r"physics:masses = \[(.*?)\]", text).group(1))
    density = float(re.search(r"tessuto:areaDensity = (\S+)", text).group(1))
    close("Newton: weight", sum(builder.particle_mass), weight)
    close("Newton: area of the flat panel", sum(builder.tri_areas), weight / density)
    report("Newton: rest angles are flat", not np.any(builder.edge_rest_angle))
    close("Newton: stretch of triangles", builder.tri_materials[0][0], stretch)
    close("Newton: bend of edges", builder.edge_bending_properties[0][0], bend)
    close("Newton: gravity", float(np.linalg.norm(builder.gravity)), GRAVITY)
    # Two hundred weights of the strip hold it as long: the solver needs many steps for more.
    soft = 200 * density * GRAVITY * expected
    soft = min(stretch, soft)
    print(f"     with the stretch of {soft:.3g} N/m for {stretch:.4g}, shear {shear:.3g} N/m not used")
    slack = newton_slope(expected, soft, bend, density, per_length=False)
    print(f"     bending as imported, an energy of ½ D [N·m] × edge [m] × angle²: {slack:.1f} degrees for {SLOPE}")
    found = overhang(lambda length: newton_slope(length, soft, bend, density, per_length=True), expected, 2)
    what = "Newton: overhang, D over the length across each edge"
    report(what, abs(found / expected - 1) < WITHIN, compared(found, expected))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", type=Path)
    parser.add_argument("--tessuto", default="tessuto")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        folder, card = Path(home) / "export", Path(home) / "card.html"
        quiet = {"check": True, "stdout": subprocess.DEVNULL}
        run = lambda *words: subprocess.run([arguments.tessuto, *map(str, words)], **quiet)
        run("export", arguments.result, "--to", "usd,mujoco", "--out", folder)
        run("fabric", arguments.result, "--out", card)
        # Of warp and weft; the overhang goes with the cube root of the stiffness.
        warp, weft = (float(v) for v in re.findall(r"<b>([\d.]+) mm</b> along", card.read_text())[:2])
        expected = math.sqrt(warp * weft) / 1e3
        print(f"     tessuto fabric: overhang {warp} and {weft} mm")
        name = next(folder.glob("*.usda")).stem
        check_mujoco(folder, name, expected)
        check_newton(folder, name, expected)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
