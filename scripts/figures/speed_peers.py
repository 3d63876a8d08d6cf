#!/usr/bin/env python3
"""Path tracing beside Mitsuba and Cycles at equal error: our squared error times core-seconds over theirs, one thread.

  PEERS          [mitsuba_path,cycles_path]
  SECONDS_EACH   core-seconds of a render [6]
  SET, SCENES, SEEDS, WIDTH, THREADS, REFERENCE_SECONDS   as in speed.py

Reading and converting the scene count for nobody. A short render comes first, after which Mitsuba finds its compiled
kernels on the disk. A scene counts where its mean is the reference's, noise apart, for both. Stores the figure
`speed-peers`. `scripts/compare/setup.sh peers` installs the others.
"""

import os
import sys
from functools import partial

DEFAULTS = {"SET": "all", "WIDTH": "96", "THREADS": "1", "REFERENCE_SECONDS": "30", "SECONDS_EACH": "6"}
for variable, value in {**DEFAULTS, "PEERS": "mitsuba_path,cycles_path"}.items():
    os.environ.setdefault(variable, value)

# First, for it finds the interpreters of the others.
import finished  # noqa: E402, F401, I001
import _peers  # noqa: E402
import _speed  # noqa: E402
from _cache import BIN, load, program  # noqa: E402
from _pictures import Layers  # noqa: E402
from record import record  # noqa: E402

WARM = 0.5


def theirs(peers, peer, seed):
    """A peer's picture of a seed, and what it spent."""
    folder = peers.render(peer, _speed.SECONDS, seed)
    return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def compared(scene, name, peer, ours, reference):
    """A row; raises Failed where the peer cannot say the scene."""
    peers = _peers.Peers(scene, reference.mean.shape[0])
    peers.render(peer, WARM, 0)
    renders = {"ours": partial(ours.render, scene, ["--method", "path"]), "theirs": partial(theirs, peers, peer)}
    found = _speed.taking_turns(renders, reference)
    return {
        "scene": name,
        "peer": peer,
        **_speed.compared(found, "ours", "theirs", _peers.stranger),
        "version": load(peers.render(peer, WARM, 0) / "run.json").get("version"),
    }


def main():
    names, reason = _peers.chosen()
    if reason:
        sys.exit(f"speed_peers: error: {reason}")
    ours, rows = _speed.Program(BIN), []
    for scene, name, reference in _speed.references():
        for peer in names:
            try:
                row = compared(scene, name, peer, ours, reference)
            except _speed.Failed as failed:
                print(f"{name:<20}{peer:<14}{failed}", flush=True)
                continue
            rows.append(row)
            note = f"{row['strange']['of']} {row['strange']['why']}" if row["strange"] else ""
            print(f"{name:<20}{peer:<14}{row['ratio']:>8.2f}  {note}", flush=True)
    found = {}
    for peer in names:
        ratios = {row["scene"]: row["ratio"] for row in rows if row["peer"] == peer and not row["strange"]}
        found[peer] = _speed.summary(ratios)
        print(peer, found[peer])
    record("speed-peers", {**_speed.SETTINGS, "program": program(), "summary": found, "rows": rows})


if __name__ == "__main__":
    main()
