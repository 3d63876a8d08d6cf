"""Other renderers on the cases, by their drivers in scripts/compare/peers.

What a driver says that it cannot translate is no failure: the case does not concern the peer. A budget is seconds for
each seed; a verdict that noise leaves open is said as such, and a longer budget settles it.
"""

import json
import os
import subprocess
from pathlib import Path

from stage import Broken, Stage

ROOT = Path(__file__).resolve().parents[2]
DRIVERS = ROOT / "scripts" / "compare" / "peers"
#: Environment of Blender's module, whose OpenEXR lies apart.
BLENDER = {"PYTHONPATH": str(ROOT / ".venv-peers" / "bpy")}
#: {peer: (driver, its mode, interpreter, variables)}
PEERS = {
    "mitsuba": ("mitsuba_driver.py", "path", ".venv-peers", {}),
    "luxcore": ("luxcore_driver.py", "bidir", ".venv-peers", {}),
    "luxcore-vm": ("luxcore_driver.py", "bidirvm", ".venv-peers", {}),
    "cycles": ("cycles_driver.py", "path", ".venv-bpy", BLENDER),
}
#: Segments of a path where a renderer needs a limit: more than any case has with a weight above its bound.
DEPTH = 1000
PATIENCE = 120


class Cannot(Exception):
    """The peer cannot be told this scene; the message is why."""


class PeerStage(Stage):
    """Plays one case with one peer."""

    def __init__(self, folder, case, peer, budget, threads=1):
        super().__init__("", folder, case, peer, threads)
        self.budget = budget

    def render(self, label, seed, *more, name=None, threads=None):
        """Renders a scene into the file that is returned."""
        driver, mode, venv, variables = PEERS[self.method]
        path, size = self.picture(name or f"{label}-{seed}"), str(self.case.size)
        command = [
            str(ROOT / venv / "bin" / "python"),
            str(DRIVERS / driver),
            str(self.scene(label)),
            str(path),
            "--mode",
            mode,
            "--width",
            size,
            "--height",
            size,
            "--budget",
            str(self.budget),
            "--threads",
            str(self.threads),
            "--seed",
            str(seed),
            "--depth",
            str(DEPTH),
        ]
        self.commands.append(command)
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                timeout=PATIENCE + self.budget,
                check=False,
                env={**os.environ, **variables},
            )
        except subprocess.TimeoutExpired:
            raise Broken(f"did not end within {PATIENCE + self.budget:g} s") from None
        said = [line for line in done.stdout.splitlines() if line.startswith("PEER ")]
        told = json.loads(said[-1][5:]) if said else {}
        if "cannot" in told:
            raise Cannot("; ".join(told["cannot"]))
        if done.returncode or not said:
            raise Broken((done.stderr.strip() or "the driver said nothing")[-300:])
        self.seconds += told.get("seconds", 0.0)
        return path
