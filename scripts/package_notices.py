#!/usr/bin/env python3
"""Prints the licences of the Rust libraries that are linked into the program and the Python module.

    package_notices.py TARGET

Equal texts are printed once, with the libraries that they belong to. Needs cargo.
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PATTERNS = ("LICEN[CS]E*", "COPYING*", "COPYRIGHT*", "NOTICE*", "UNLICENSE*")


def metadata():
    """Returns the crates of the workspace and their dependencies for the released target, as `cargo metadata` prints
    them."""
    words = ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", sys.argv[1]]
    return json.loads(subprocess.run(words, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)


def linked(found):
    """Ids of the packages that the workspace's packages link, directly or not."""
    dependencies = {
        node["id"]: [d["pkg"] for d in node["deps"] if any(kind["kind"] is None for kind in d["dep_kinds"])]
        for node in found["resolve"]["nodes"]}
    reached, left = set(), list(found["workspace_members"])
    while left:
        package = left.pop()
        if package not in reached:
            reached.add(package)
            left += dependencies[package]
    return reached - set(found["workspace_members"])


def texts(package):
    """The texts of a package's licence files."""
    folder = Path(package["manifest_path"]).parent
    files = {file for pattern in PATTERNS for file in folder.glob(pattern) if file.is_file()}
    return [file.read_text(encoding="utf-8", errors="replace").strip() for file in sorted(files)]


def standard_library():
    """Name and licence text of Rust's standard library."""
    root = subprocess.run(["rustc", "--print", "sysroot"], check=True, stdout=subprocess.PIPE, text=True).stdout
    files = sorted(Path(root.strip(), "share/doc/rust").glob("COPYRIGHT*"))
    return "Rust's standard library: MIT OR Apache-2.0", [f.read_text(encoding="utf-8").strip() for f in files[:1]]


def main():
    found = metadata()
    wanted = linked(found)
    packages = [p for p in found["packages"] if p["id"] in wanted]
    titled = sorted((f"{p['name']} {p['version']}: {p['license']}", texts(p)) for p in packages)
    owners = defaultdict(list)
    for title, own in [standard_library(), *titled]:
        for text in own or [""]:
            owners[text].append(title)
    print("Licences of the Rust libraries in this package")
    for text, titles in owners.items():
        print("\n" + "=" * 80, *titles, sep="\n")
        print("\n" + (text or "No licence file of its own; the licence named above applies."))


if __name__ == "__main__":
    main()
