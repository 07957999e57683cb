#!/usr/bin/env python3
"""Prints what the program contains by others: every crate that is linked into it, with its licence and that
licence's text, and what the report page embeds.

usage: licences.py [--target x86_64-unknown-linux-gnu] [--package tessuto-cli] > LICENSES.txt

Ends with status 1 if a crate names no licence. `cargo deny check licenses` holds them to those that deny.toml allows.
"""

import argparse
import json
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LINE = "=" * 100


def linked(metadata, name):
    """Packages of the default build of package `name` that end in it: not those that run while it is built."""
    packages = {package["id"]: package for package in metadata["packages"]}
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    todo = [package["id"] for package in metadata["packages"] if package["name"] == name]
    seen = set(todo)
    while todo:
        for dependency in nodes[todo.pop()]["deps"]:
            package = packages[dependency["pkg"]]
            normal = any(kind["kind"] is None for kind in dependency["dep_kinds"])
            macros = any("proc-macro" in target["kind"] for target in package["targets"])
            if normal and not macros and package["id"] not in seen:
                seen.add(package["id"])
                todo.append(package["id"])
    return sorted((packages[i] for i in seen), key=lambda package: (package["name"], package["version"]))


def texts(folder):
    names = [
        path
        for path in folder.iterdir()
        if path.is_file() and re.match(r"(?i)(unlicense|licen[cs]e|copying|notice)", path.name)
    ]
    return [(path.name, path.read_text(errors="replace").strip()) for path in sorted(names)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--target", default="x86_64-unknown-linux-gnu")
    parser.add_argument("--package", default="tessuto-cli")
    arguments = parser.parse_args()
    target, name = arguments.target, arguments.package
    command = [
        "cargo",
        "metadata",
        "--format-version",
        "1",
        "--locked",
        "--filter-platform",
        target,
        "--manifest-path",
        ROOT / "crates" / name / "Cargo.toml",
    ]
    packages = linked(json.loads(subprocess.run(command, check=True, capture_output=True).stdout), name)
    unnamed = [package["name"] for package in packages if not package["license"]]
    if unnamed:
        sys.exit(f"these name no licence: {unnamed}")
    where = {}  # text: what it is the licence of
    for package in packages:
        for name, text in texts(Path(package["manifest_path"]).parent):
            where.setdefault(text, []).append(f"{package['name']} {package['version']} ({name})")
    vendor = ROOT / "crates/tessuto/assets/vendor"
    for path in sorted(vendor.glob("*.LICENSE")):
        where.setdefault(path.read_text().strip(), []).append(f"{path.stem}, embedded in the report page")
    print(
        f"tessuto is licensed MIT OR Apache-2.0. It contains {len(packages)} crates, its own among them, and "
        f"Rust's standard library (MIT OR Apache-2.0):\n"
    )
    for package in packages:
        print("{name:28} {version:12} {license:40} {home}".format(home=package["repository"] or "", **package).rstrip())
    without = [p["name"] for p in packages if not texts(Path(p["manifest_path"]).parent)]
    if without:
        print(f"\nNo text of their own, the licence is that of the list: {', '.join(without)}")
    for text, owners in sorted(where.items(), key=lambda item: item[1]):
        print(f"\n{LINE}\n" + "\n".join(owners) + f"\n{LINE}\n\n{text}")


main()
