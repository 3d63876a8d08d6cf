"""Public renderers on our scenes, by their drivers in scripts/compare/peers.

`scripts/compare/setup.sh peers` installs them. On the clock of core-seconds a budget is seconds times threads.
"""

from pathlib import Path

import caller

from .cache import BIN, CACHE, Failed, digest, load, making, save, scene_key, timed
from .options import options
from .picture_errors import Layers, write
from .renders import PYTHON, denoised

# Iterations of the guides that all peers' pictures are denoised with.
GUIDES = 64
# A picture whose mean is so far from the reference's, its noise apart, is of another scene.
SAME = 0.02
PEERS = {
    "mitsuba_path": ("mitsuba_driver.py", "path"),
    "lux_path": ("luxcore_driver.py", "path"),
    "lux_path_caustic": ("luxcore_driver.py", "path_cache"),
    "lux_bidir": ("luxcore_driver.py", "bidir"),
    "lux_bidirvm": ("luxcore_driver.py", "bidirvm"),
    "cycles_path": ("cycles_driver.py", "path"),
    "cycles_guiding": ("cycles_driver.py", "path_guiding"),
}
DEFAULT = ["mitsuba_path", "lux_bidir", "lux_path_caustic", "lux_bidirvm", "cycles_path"]
INSTALL = "make it by scripts/compare/setup.sh peers"


def chosen():
    """The peers asked for, and what keeps them out, if anything does."""
    names = options.peers
    unknown = set(names) - set(PEERS)
    if unknown:
        raise SystemExit(f"--peers: {', '.join(sorted(unknown))} is not among {', '.join(PEERS)}")
    if names and not PYTHON:
        return [], f"peers are left out: there is no .venv-peers; {INSTALL}"
    return names, None


class Peers:
    """The peers on one scene."""

    def __init__(self, scene, height):
        tools = sorted(caller.DRIVERS.glob("*.py"))
        self.place = CACHE / "peers" / digest(*tools) / scene_key(scene) / str(options.width)
        self.scene, self.height = scene, height

    def _drive(self, driver, target, **words):
        """Runs a driver; returns its answer, with the core-seconds of the process."""
        size = {"width": options.width, "height": self.height, "threads": options.threads}
        command = caller.command(driver, self.scene, target, **size, **words)
        if not Path(command[0]).exists():
            raise Failed(f"{command[0]} is not there; {INSTALL}")
        text, _, spent = timed(command, 600 + 10 * float(words["budget"]), caller.environment(driver))
        try:
            answer = caller.answer(text)
        except caller.CannotTranslate as cannot:
            return {"cannot": str(cannot), "process_core_seconds": round(spent, 2)}
        if answer is None:
            raise Failed("the driver says nothing of what it did")
        return {**answer, "process_core_seconds": round(spent, 2)}

    def guides(self):
        """Albedo and normal, nearly without noise, made once by our path tracing and not counted."""
        folder = self.place / "guides"
        if not (folder / "guides.exr").exists():
            with making(folder) as draft:
                command = [BIN, "render", self.scene, "-o", draft / "guides.exr", "--method", "path", "--no-combine"]
                command += ["--iterations", GUIDES, "--width", options.width, "--layers", "albedo,normal"]
                timed([*command, "--progress", "none"])
        layers = Layers(folder / "guides.exr")
        return {"albedo": layers.get("albedo"), "normal": layers.get("normal", "XYZ")}

    def render(self, peer, budget, seed):
        """Renders by a peer, unless that is done; returns the folder."""
        folder = self.place / f"{peer}-{budget:g}s-{options.threads}-seed{seed}"
        known = load(folder / "run.json")
        if known is None:
            with making(folder) as draft:
                driver, mode = PEERS[peer]
                words = {"mode": mode, "budget": budget, "seed": seed, "clock": "cpu"}
                known = self._drive(driver, draft / "picture.exr", **words)
                known["cpu_seconds"] = known.get("core_seconds")
                save(draft / "run.json", known)
        if "cannot" in known:
            raise Failed(f"no faithful translation: {known['cannot']}")
        return folder

    def pictures(self, folder):
        """A peer's picture, and the same with OIDN and the guides."""
        found = {"noisy": Layers(folder / "picture.exr").get("")}
        if not (folder / "oidn.exr").exists():
            write(folder / "noisy.exr", picture=found["noisy"], **self.guides())
        if denoised(folder, "noisy.exr", "oidn.exr"):
            found["oidn"] = Layers(folder / "oidn.exr").get("")
            (folder / "noisy.exr").unlink(missing_ok=True)
        return found


def stranger(noisy):
    """Why a peer's picture is not of the same scene, by its mean; nothing where it is."""
    off = abs(noisy["mean_ratio"] - 1)
    if off <= SAME + 2 * noisy["mean_ratio_error"]:
        return None
    ratio, noise = noisy["mean_ratio"], noisy["mean_ratio_error"]
    return f"not comparable: its mean is {ratio:.3f} of the reference's, of which {noise:.3f} may be noise"
