#!/usr/bin/env python3
"""Core-seconds to the same error, after over before: this program beside one of an older commit, scene by scene.

  BEFORE         a commit [that before points of a sequence, roulette and merge weights came in], which is built in a
                 folder of the cache, or a program
  METHODS        [path,bdpt,vcm,sppm]
  SECONDS_EACH   core-seconds of a render [2]
  SET [all], SCENES, SEEDS [2], WIDTH [96], THREADS [1], REFERENCE_SECONDS [30]   as in finished.py

A method counts where it finds the light: where its mean is the reference's, noise apart, in both programs. Stores the
figure `speed`.
"""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

import _speed
from _cache import BIN, program
from _peers import stranger
from record import ROOT, record

# The parent of what brought low-discrepancy points to paths of pixels.
BEFORE = os.environ.get("BEFORE", "250baf33979a^")
METHODS = os.environ.get("METHODS", "path,bdpt,vcm,sppm").split(",")


def built(commit):
    """The program of a commit, built in the cache once; and the commit in full."""
    name = subprocess.run(
        ["git", "-C", ROOT, "rev-parse", "--verify", f"{commit}^{{commit}}"], capture_output=True, text=True
    ).stdout.strip()
    if not name:
        sys.exit(f"speed: error: BEFORE={commit} is neither a program nor a commit of this repository")
    place = _speed.PLACE / name[:10]
    binary = place / "target" / "release" / "caustique"
    if not binary.exists():
        tree = place / "tree"
        if not tree.exists():
            subprocess.run(["git", "-C", ROOT, "worktree", "add", "--force", "--detach", tree, name], check=True)
        own = {**os.environ, "CARGO_TARGET_DIR": str(place / "target")}
        subprocess.run(["cargo", "build", "--release", "--bin", "caustique"], cwd=tree, env=own, check=True)
        subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)
    return binary, name


def measure(scene, name, method, programs, reference):
    """A row."""
    options = ["--method", method]
    renders = {of: partial(one.render, scene, options) for of, one in programs.items()}
    found = _speed.taking_turns(renders, reference)
    return {"scene": name, "method": method, **_speed.compared(found, "after", "before", stranger)}


def main():
    before, commit = (Path(BEFORE), None) if Path(BEFORE).is_file() else built(BEFORE)
    programs = {"before": _speed.Program(before), "after": _speed.Program(BIN)}
    rows = []
    print(f"{'':<20}{'':<6}{'before':>11}{'after':>11}{'ratio':>8}  (relMSE, trimmed, times core-seconds)")
    for scene, name, reference in _speed.references():
        for method in METHODS:
            try:
                row = measure(scene, name, method, programs, reference)
            except _speed.Failed as failed:
                print(f"{name:<20}{method:<6}{failed}", flush=True)
                continue
            rows.append(row)
            merits = "".join(f"{row[of]['merit']:>11.3g}" for of in programs)
            note = f"  {row['strange']['of']} {row['strange']['why']}" if row["strange"] else ""
            print(f"{name:<20}{method:<6}{merits}{row['ratio']:>8.2f}{note}", flush=True)
    counted = {f"{row['scene']}, {row['method']}": row for row in rows if not row["strange"]}
    found = {}
    for of in [*METHODS, "all"]:
        ratios = {name: row["ratio"] for name, row in counted.items() if of in ("all", row["method"])}
        found[of] = _speed.summary(ratios)
        if ratios:
            one = found[of]
            worst = f"worst {one['worst']:.2f} ({one['where']})"
            print(f"{of:<6} geometric mean {one['geometric_mean']:.3f}, {worst}, of {one['of']}")
    record("speed", {**_speed.SETTINGS, "program": program(), "before": commit, "summary": found, "rows": rows})


if __name__ == "__main__":
    main()
