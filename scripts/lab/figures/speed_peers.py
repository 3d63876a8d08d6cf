"""Path tracing beside Mitsuba and Cycles: our squared error times core-seconds over theirs, on one thread.

Reading and converting the scene are not counted for any renderer. A short render runs first, so that Mitsuba finds its
compiled kernels on the disk. A scene counts if both means agree with the reference's within noise. Stores the figure
`speed-peers`. `scripts/compare/setup.sh peers` installs the other renderers.
"""

import sys
from functools import partial

from .. import peer_runs, speed_runs
from ..cache import BIN, load, program
from ..options import options
from ..picture_errors import Layers
from ..record import record

ARGUMENTS = speed_runs.ARGUMENTS | {"peers": ["mitsuba_path", "cycles_path"], "seconds": 6.0}
WARM_UP = 0.5  # seconds


def render_peer(peers, peer, seed):
    """Renders by a peer with a seed; returns the picture and its core-seconds."""
    folder = peers.render(peer, options.seconds, seed)
    return Layers(folder / "picture.exr").get(""), load(folder / "run.json")["cpu_seconds"]


def compare(scene, name, peer, ours, reference):
    """The row of a scene and a peer; raises Failed if the peer cannot render the scene."""
    peers = peer_runs.Peers(scene, reference.mean.shape[0])
    peers.render(peer, WARM_UP, 0)
    renders = {"ours": partial(ours.render, scene, ["--method", "path"]), "theirs": partial(render_peer, peers, peer)}
    found = speed_runs.measure_alternately(renders, reference)
    return {
        "scene": name,
        "peer": peer,
        **speed_runs.compare(found, "ours", "theirs", peer_runs.mean_mismatch),
        "version": load(peers.render(peer, WARM_UP, 0) / "run.json").get("version"),
    }


def main():
    names, reason = peer_runs.select()
    if reason:
        sys.exit(f"speed_peers: error: {reason}")
    ours, rows = speed_runs.Program(BIN), []
    for scene, name, reference in speed_runs.with_references():
        for peer in names:
            try:
                row = compare(scene, name, peer, ours, reference)
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
