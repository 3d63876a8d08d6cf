"""Public renderers on our scenes, by their drivers in scripts/compare/peers.

PEERS_PYTHON and PEERS_PYTHON_BPY are the interpreters that `scripts/compare/setup.sh peers` makes. On the clock of
core-seconds a budget is seconds times threads.
"""

import json
import os
import sys

from _cache import BIN, CACHE, THREADS, WIDTH, Failed, digest, load, making, save, scene_key, timed
from _pictures import Layers, write
from _renders import PYTHON, denoised
from record import ROOT

DRIVERS = ROOT / "scripts" / "compare" / "peers"
BPY = os.environ.get("PEERS_PYTHON_BPY", "")
# OpenEXR for Blender's module lies apart.
BPY_PACKAGES = ROOT / ".venv-peers" / "bpy"
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
DEFAULT = "mitsuba_path,lux_bidir,lux_path_caustic,lux_bidirvm,cycles_path"
INSTALL = "make it by scripts/compare/setup.sh peers"

sys.path.append(str(DRIVERS))


def chosen():
    """The peers asked for, and what keeps them out, if anything does."""
    names = [name for name in os.environ.get("PEERS", DEFAULT).split(",") if name]
    unknown = set(names) - set(PEERS)
    if unknown:
        raise SystemExit(f"PEERS: {', '.join(sorted(unknown))} is not among {', '.join(PEERS)}")
    if names and not PYTHON:
        return [], f"peers are left out: there is no .venv-peers; {INSTALL}, or set PEERS_PYTHON"
    return names, None


class Peers:
    """The peers on one scene."""

    def __init__(self, scene, height):
        tools = [*sorted(DRIVERS.glob("*.py")), *sorted(DRIVERS.parent.glob("*.py"))]
        self.place = CACHE / "peers" / digest(*tools) / scene_key(scene) / str(WIDTH)
        self.scene, self.height = scene, height

    def _drive(self, script, target, *options):
        """Runs a driver; returns what it says, with the core-seconds of the process."""
        python, env = PYTHON, None
        if script.startswith("cycles"):
            python, env = BPY, {**os.environ, "PYTHONPATH": str(BPY_PACKAGES)}
        if not python:
            raise Failed(f"there is no .venv-bpy; {INSTALL}, or set PEERS_PYTHON_BPY")
        command = [python, DRIVERS / script, self.scene, target, "--width", WIDTH, "--height", self.height]
        limit = 600 + 10 * float(options[options.index("--budget") + 1])
        text, _, spent = timed([*command, "--threads", THREADS, *options], limit, env)
        said = [line for line in text.splitlines() if line.startswith("PEER ")]
        if not said:
            raise Failed("the driver says nothing of what it did")
        return {**json.loads(said[-1][5:]), "process_core_seconds": round(spent, 2)}

    def guides(self):
        """Albedo and normal, nearly without noise, made once by our path tracing and not counted."""
        folder = self.place / "guides"
        if not (folder / "guides.exr").exists():
            with making(folder) as draft:
                command = [BIN, "render", self.scene, "-o", draft / "guides.exr", "--method", "path", "--no-combine"]
                command += ["--iterations", GUIDES, "--width", WIDTH, "--layers", "albedo,normal"]
                timed([*command, "--progress", "none"])
        layers = Layers(folder / "guides.exr")
        return {"albedo": layers.get("albedo"), "normal": layers.get("normal", "XYZ")}

    def render(self, peer, budget, seed):
        """Renders by a peer, unless that is done; returns the folder."""
        folder = self.place / f"{peer}-{budget:g}s-{THREADS}-seed{seed}"
        known = load(folder / "run.json")
        if known is None:
            with making(folder) as draft:
                script, mode = PEERS[peer]
                options = ["--mode", mode, "--budget", budget, "--seed", seed, "--clock", "cpu"]
                known = self._drive(script, draft / "picture.exr", *options)
                known["cpu_seconds"] = known.get("core_seconds")
                save(draft / "run.json", known)
        if "cannot" in known:
            more = f", and {len(known['cannot']) - 1} more" if len(known["cannot"]) > 1 else ""
            raise Failed(f"no faithful translation: {known['cannot'][0]}{more}")
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
