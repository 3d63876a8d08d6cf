"""Cases rendered by other renderers, through their drivers in scripts/compare/peers.

A case that a driver cannot translate is not a failure of the peer. The budget is the seconds of each picture; an
undecided verdict needs a longer budget.
"""

import subprocess

import caller
from caller import CannotTranslate

from .stage import Broken, Stage

#: {peer: (driver, its mode)}
PEERS = {
    "mitsuba": ("mitsuba_driver.py", "path"),
    "luxcore": ("luxcore_driver.py", "bidir"),
    "luxcore-vm": ("luxcore_driver.py", "bidirvm"),
    "cycles": ("cycles_driver.py", "path"),
}
#: Limit on the segments of a path, for renderers that need one; longer paths are below the bound of every case.
DEPTH = 1000
#: Seconds that a driver may take besides its budget.
TIMEOUT = 120

__all__ = ["PEERS", "CannotTranslate", "PeerStage"]


class PeerStage(Stage):
    """Renders one case by one peer."""

    def __init__(self, folder, case, peer, budget, threads=1):
        super().__init__("", folder, case, peer, threads)
        self.budget = budget

    def render(self, label, seed, *more, name=None, threads=None):
        """Renders a scene; returns the file of the picture."""
        driver, mode = PEERS[self.method]
        path, size = self.picture(name or f"{label}-{seed}"), self.case.size
        options = {"mode": mode, "width": size, "height": size, "budget": self.budget, "threads": self.threads}
        command = caller.command(driver, self.scene(label), path, **options, seed=seed, depth=DEPTH)
        self.commands.append(command)
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                timeout=TIMEOUT + self.budget,
                check=False,
                env=caller.environment(driver),
            )
        except subprocess.TimeoutExpired:
            raise Broken(f"did not end within {TIMEOUT + self.budget:g} s") from None
        answer = caller.answer(done.stdout)
        if done.returncode or answer is None:
            raise Broken((done.stderr.strip() or "the driver has printed no answer")[-300:])
        self.seconds += answer.get("seconds", 0.0)
        return path
