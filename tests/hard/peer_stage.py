"""Other renderers on the cases, by their drivers in scripts/compare/peers.

What a driver says that it cannot translate is no failure: the case does not concern the peer. A budget is seconds for
each seed; a verdict that noise leaves open is said as such, and a longer budget settles it.
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
#: Segments of a path where a renderer needs a limit: more than any case has with a weight above its bound.
DEPTH = 1000
PATIENCE = 120

__all__ = ["PEERS", "CannotTranslate", "PeerStage"]


class PeerStage(Stage):
    """Plays one case with one peer."""

    def __init__(self, folder, case, peer, budget, threads=1):
        super().__init__("", folder, case, peer, threads)
        self.budget = budget

    def render(self, label, seed, *more, name=None, threads=None):
        """Renders a scene into the file that is returned."""
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
                timeout=PATIENCE + self.budget,
                check=False,
                env=caller.environment(driver),
            )
        except subprocess.TimeoutExpired:
            raise Broken(f"did not end within {PATIENCE + self.budget:g} s") from None
        told = caller.answer(done.stdout)
        if done.returncode or told is None:
            raise Broken((done.stderr.strip() or "the driver said nothing")[-300:])
        self.seconds += told.get("seconds", 0.0)
        return path
