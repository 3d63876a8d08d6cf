"""Core-seconds to an equal error, after over before: this program and one of an older commit, scene by scene.

The older commit is by default the last one without low-discrepancy points, late roulette and correlation-aware merge
weights. A row counts if the means of both programs agree with the reference's within noise, so that both find the light.
Stores the figure `speed`.
"""

import os
import subprocess
import sys
from functools import partial
from pathlib import Path

from .. import speed_runs
from ..cache import BIN, program
from ..options import options
from ..peer_runs import mean_mismatch
from ..record import ROOT, record

# The default is the parent of the commit that introduced low-discrepancy points.
ARGUMENTS = speed_runs.ARGUMENTS | {"before": "250baf33979a^", "methods": ["path", "bdpt", "vcm", "sppm"]}


def build(commit):
    """Builds the program of a commit in the cache, unless it exists; returns the program and the full hash."""
    name = subprocess.run(
        ["git", "-C", ROOT, "rev-parse", "--verify", f"{commit}^{{commit}}"], capture_output=True, text=True
    ).stdout.strip()
    if not name:
        sys.exit(f"speed: error: --before {commit} is neither a program nor a commit of this repository")
    place = speed_runs.PLACE / name[:10]
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
    """The row of a scene and a method."""
    renders = {of: partial(one.render, scene, ["--method", method]) for of, one in programs.items()}
    found = speed_runs.measure_alternately(renders, reference)
    return {"scene": name, "method": method, **speed_runs.compare(found, "after", "before", mean_mismatch)}


def main():
    before, commit = (Path(options.before), None) if Path(options.before).is_file() else build(options.before)
    programs = {"before": speed_runs.Program(before), "after": speed_runs.Program(BIN)}
    rows = []
    print(f"{'':<20}{'':<6}{'before':>11}{'after':>11}{'ratio':>8}  (relMSE, trimmed, times core-seconds)")
    for scene, name, reference in speed_runs.with_references():
        for method in options.methods:
            try:
                row = measure(scene, name, method, programs, reference)
            except speed_runs.Failed as failed:
                print(f"{name:<20}{method:<6}{failed}", flush=True)
                continue
            rows.append(row)
            merits = "".join(f"{row[of]['merit']:>11.3g}" for of in programs)
            note = f"  {row['strange']['of']} {row['strange']['why']}" if row["strange"] else ""
            print(f"{name:<20}{method:<6}{merits}{row['ratio']:>8.2f}{note}", flush=True)
    counted = {f"{row['scene']}, {row['method']}": row for row in rows if not row["strange"]}
    found = {}
    for of in [*options.methods, "all"]:
        ratios = {name: row["ratio"] for name, row in counted.items() if of in ("all", row["method"])}
        found[of] = speed_runs.summary(ratios)
        if ratios:
            one = found[of]
            worst = f"worst {one['worst']:.2f} ({one['where']})"
            print(f"{of:<6} geometric mean {one['geometric_mean']:.3f}, {worst}, of {one['of']}")
    record("speed", {**speed_runs.settings(), "program": program(), "before": commit, "summary": found, "rows": rows})
