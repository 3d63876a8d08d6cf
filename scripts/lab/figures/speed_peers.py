"""Path tracing beside Mitsuba and Cycles at equal error: our squared error times core-seconds over theirs, one thread.

Reading and converting the scene count for nobody. A short render comes first, after which Mitsuba finds its compiled
kernels on the disk. A scene counts where its mean is the reference's, noise apart, for both. Stores the figure
`speed-peers`. `scripts/compare/setup.sh peers` installs the others.
"""

import sys
from functools import partial

from .. import peer_runs, speed_runs
from ..cache import BIN, load, program
from ..options import options
from ..picture_errors import Layers
from ..record import record

ARGUMENTS = speed_runs.ARGUMENTS | {"peers": ["mitsuba_path", "cycles_path"], "seconds": 6.0}
WARM = 0.5


def theirs(peers, peer, seed):
    """A peer's picture of a seed, and what it spent."""
    folder = peers.render(peer, options.seconds, seed)
    return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def compared(scene, name, peer, ours, reference):
    """A row; raises Failed where the peer cannot say the scene."""
    peers = peer_runs.Peers(scene, reference.mean.shape[0])
    peers.render(peer, WARM, 0)
    renders = {"ours": partial(ours.render, scene, ["--method", "path"]), "theirs": partial(theirs, peers, peer)}
    found = speed_runs.taking_turns(renders, reference)
    return {
        "scene": name,
        "peer": peer,
        **speed_runs.compared(found, "ours", "theirs", peer_runs.stranger),
        "version": load(peers.render(peer, WARM, 0) / "run.json").get("version"),
    }


def main():
    names, reason = peer_runs.chosen()
    if reason:
        sys.exit(f"speed_peers: error: {reason}")
    ours, rows = speed_runs.Program(BIN), []
    for scene, name, reference in speed_runs.with_references():
        for peer in names:
            try:
                row = compared(scene, name, peer, ours, reference)
            except speed_runs.Failed as failed:
                print(f"{name:<20}{peer:<14}{failed}", flush=True)
                continue
            rows.append(row)
            note = f"{row['strange']['of']} {row['strange']['why']}" if row["strange"] else ""
            print(f"{name:<20}{peer:<14}{row['ratio']:>8.2f}  {note}", flush=True)
    found = {}
    for peer in names:
        ratios = {row["scene"]: row["ratio"] for row in rows if row["peer"] == peer and not row["strange"]}
        found[peer] = speed_runs.summary(ratios)
        print(peer, found[peer])
    record("speed-peers", {**speed_runs.settings(), "program": program(), "summary": found, "rows": rows})
