"""Public renderers on our scenes: their drivers, which are no part of this repository, and what a scene is to them.

CAUSTIQUE_PEERS names the folder of the drivers. Each is called as

    PYTHON mitsuba_peer.py FOLDER OUT.exr --mode MODE --budget SECONDS --threads T --seed S --clock cpu --depth D

with FOLDER holding NAME.glb, NAME.json and the environment's image (see _translate.py), writes a linear picture, and
prints `PEER {..}` with what it did; so are luxcore_peer.py and cycles_peer.py. PEERS_PYTHON and PEERS_PYTHON_BPY are
the interpreters that scripts/figures/peers.sh makes. On the clock of core-seconds a budget is seconds times threads.
"""

import json
import os
import shutil
from pathlib import Path

import _translate
from _cache import CACHE, THREADS, WIDTH, Failed, digest, load, making, save, scene_key, timed
from _pictures import Layers, write
from _renders import PYTHON, denoised
from record import ROOT

DRIVERS = os.environ.get("CAUSTIQUE_PEERS", "")
BPY = os.environ.get("PEERS_PYTHON_BPY", "")
# OpenEXR for Blender's module lies apart.
BPY_PACKAGES = ROOT / ".venv-peers" / "bpy"
# Path length of the peers, in segments; ours has no limit.
DEPTH = 32
# A picture whose mean is so far from the reference's, its noise apart, is of another scene.
SAME = 0.02
PEERS = {
    "mitsuba_path": ("mitsuba_peer.py", "path"),
    "lux_path": ("luxcore_peer.py", "path"),
    "lux_path_caustic": ("luxcore_peer.py", "path_caustic"),
    "lux_bidir": ("luxcore_peer.py", "bidir"),
    "lux_bidirvm": ("luxcore_peer.py", "bidirvm"),
    "cycles_path": ("cycles_peer.py", "path"),
    "cycles_guiding": ("cycles_peer.py", "path_guiding"),
}
DEFAULT = "mitsuba_path,lux_bidir,lux_path_caustic,lux_bidirvm,cycles_path"


def chosen():
    """The peers asked for, and what keeps them out, if anything does."""
    names = [name for name in os.environ.get("PEERS", DEFAULT).split(",") if name]
    unknown = set(names) - set(PEERS)
    if unknown:
        raise SystemExit(f"PEERS: {', '.join(sorted(unknown))} is not among {', '.join(PEERS)}")
    if not names:
        return [], None
    if not DRIVERS:
        return (
            [],
            "peers are left out: CAUSTIQUE_PEERS names no folder with drivers such as mitsuba_peer.py (see _peers.py)",
        )
    missing = sorted({PEERS[name][0] for name in names if not (Path(DRIVERS) / PEERS[name][0]).exists()})
    if missing:
        return [], f"peers are left out: {DRIVERS} has no {', '.join(missing)}"
    if not PYTHON:
        return (
            [],
            "peers are left out: there is no .venv-peers; make it by scripts/figures/peers.sh, or set PEERS_PYTHON",
        )
    return names, None


class Peers:
    """The peers on one scene."""

    def __init__(self, scene, height):
        tools = [*sorted(Path(DRIVERS).glob("*.py")), Path(_translate.__file__)]
        self.place = CACHE / "peers" / digest(*tools) / scene_key(scene) / str(WIDTH)
        translation = _translate.Translation(scene)
        self.blockers = list(dict.fromkeys(translation.blockers))
        self.approximations = translation.approximations
        self.folder = self.place / "scene" / scene.stem
        if not self.blockers:
            shutil.rmtree(self.folder, ignore_errors=True)
            translation.save(self.folder, WIDTH, height)

    def _drive(self, script, mode, target, *options):
        python, env = (
            (BPY, {**os.environ, "PYTHONPATH": str(BPY_PACKAGES)}) if script.startswith("cycles") else (PYTHON, None)
        )
        if not python:
            raise Failed("there is no .venv-bpy; make it by scripts/figures/peers.sh, or set PEERS_PYTHON_BPY")
        command = [python, Path(DRIVERS) / script, self.folder, target, "--mode", mode, "--threads", THREADS, *options]
        limit = 600 + 10 * float(options[options.index("--budget") + 1]) if "--budget" in options else 600
        text, _, spent = timed(command, limit, env)
        said = [line for line in text.splitlines() if line.startswith("PEER ")]
        return {**(json.loads(said[-1][5:]) if said else {}), "process_core_seconds": round(spent, 2)}

    def guides(self):
        """Albedo and normal without noise, made once by Mitsuba and not counted."""
        folder = self.place / "guides"
        if not (folder / "albedo.exr").exists():
            with making(folder) as draft:
                self._drive("mitsuba_peer.py", "aov", draft / "albedo.exr")
        return {"albedo": Layers(folder / "albedo.exr").get(""), "normal": Layers(folder / "albedo_normal.exr").get("")}

    def render(self, peer, budget, seed):
        """Renders by a peer, unless that is done; returns the folder."""
        if self.blockers:
            more = f", and {len(self.blockers) - 1} more" if len(self.blockers) > 1 else ""
            raise Failed(f"no faithful translation: {self.blockers[0]}{more}")
        folder = self.place / f"{peer}-{budget:g}s-{THREADS}-seed{seed}"
        if load(folder / "run.json") is None:
            with making(folder) as draft:
                script, mode = PEERS[peer]
                known = self._drive(
                    script,
                    mode,
                    draft / "picture.exr",
                    "--budget",
                    budget,
                    "--seed",
                    seed,
                    "--clock",
                    "cpu",
                    "--depth",
                    DEPTH,
                )
                known["cpu_seconds"] = round(known["seconds"] * THREADS, 3)
                save(draft / "run.json", known)
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
