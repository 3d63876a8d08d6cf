"""Renders of our scenes by other renderers, through their drivers in scripts/compare/peers.

`scripts/compare/setup.sh peers` installs the renderers. A budget in core-seconds is seconds times threads.
"""

from pathlib import Path

import caller

from .cache import CACHE, Failed, create, digest, load, run_timed, save, scene_key
from .commands import command
from .options import options
from .picture_errors import Layers, write
from .renders import PYTHON, denoise_file

# Iterations of the albedo and normal that guide the denoiser on all peers' pictures.
GUIDE_ITERATIONS = 64
# Largest relative difference of the means, besides noise, of two pictures of one scene.
MAX_MEAN_DIFFERENCE = 0.02
PEERS = {
    "mitsuba_path": ("mitsuba_driver.py", "path"),
    "lux_path": ("luxcore_driver.py", "path"),
    "lux_path_caustic": ("luxcore_driver.py", "path_cache"),
    "lux_bidir": ("luxcore_driver.py", "bidir"),
    "lux_bidirvm": ("luxcore_driver.py", "bidirvm"),
    "cycles_path": ("cycles_driver.py", "path"),
    "cycles_guiding": ("cycles_driver.py", "path_guiding"),
    "cycles_caustics": ("cycles_driver.py", "path_caustics"),
}
DEFAULT = ["mitsuba_path", "lux_bidir", "lux_path_caustic", "lux_bidirvm", "cycles_path"]
INSTALL = "scripts/compare/setup.sh peers creates it"


def select():
    """The selected peers, and why they cannot run, or None."""
    names = options.peers
    unknown = set(names) - set(PEERS)
    if unknown:
        raise SystemExit(f"--peers: {', '.join(sorted(unknown))}: not one of {', '.join(PEERS)}")
    if names and not PYTHON:
        return [], f"other renderers are left out: there is no .venv-peers; {INSTALL}"
    return names, None


class Peers:
    """Renders of one scene by the peers."""

    def __init__(self, scene, height):
        tools = sorted(caller.DRIVERS.glob("*.py"))
        self.place = CACHE / "peers" / digest(*tools) / scene_key(scene) / str(options.width)
        self.scene, self.height = scene, height

    def _drive(self, driver, target, **words):
        """Runs a driver; returns its answer with the core-seconds of the process."""
        size = {"width": options.width, "height": self.height, "threads": options.threads}
        line = caller.command(driver, self.scene, target, **size, **words)
        if not Path(line[0]).exists():
            raise Failed(f"{line[0]} does not exist; {INSTALL}")
        text, _, spent = run_timed(line, 600 + 10 * float(words["budget"]), caller.environment(driver))
        try:
            answer = caller.answer(text)
        except caller.CannotTranslate as cannot:
            return {"cannot": str(cannot), "process_core_seconds": round(spent, 2)}
        if answer is None:
            raise Failed("the driver has printed no answer")
        return {**answer, "process_core_seconds": round(spent, 2)}

    def guides(self):
        """Albedo and normal with little noise, rendered once by our path tracing; their time is not counted."""
        folder = self.place / "guides"
        if not (folder / "guides.exr").exists():
            with create(folder) as draft:
                words = ["render", self.scene, "-o", draft / "guides.exr"]
                settings = {"method": "path", "no_finish": True, "iterations": GUIDE_ITERATIONS}
                settings |= {"width": options.width, "layers": "albedo,normal", "progress": "none"}
                run_timed(command(*words, **settings))
        layers = Layers(folder / "guides.exr")
        return {"albedo": layers.get("albedo"), "normal": layers.get("normal", "XYZ")}

    def render(self, peer, budget, seed):
        """Renders by a peer, unless the cache has the render; returns the folder."""
        folder = self.place / f"{peer}-{budget:g}s-{options.threads}-seed{seed}"
        known = load(folder / "run.json")
        if known is None:
            with create(folder) as draft:
                driver, mode = PEERS[peer]
                words = {"mode": mode, "budget": budget, "seed": seed, "clock": "cpu"}
                known = self._drive(driver, draft / "picture.exr", **words)
                known["cpu_seconds"] = known.get("core_seconds")
                save(draft / "run.json", known)
        if "cannot" in known:
            raise Failed(f"no faithful translation: {known['cannot']}")
        return folder

    def pictures(self, folder):
        """Returns a renderer's picture (`noisy`) and, if OIDN is installed, that picture denoised with noise-free
        guides (`oidn`)."""
        found = {"noisy": Layers(folder / "picture.exr").get("")}
        if not (folder / "oidn.exr").exists():
            write(folder / "noisy.exr", picture=found["noisy"], **self.guides())
        if denoise_file(folder, "noisy.exr", "oidn.exr"):
            found["oidn"] = Layers(folder / "oidn.exr").get("")
            (folder / "noisy.exr").unlink(missing_ok=True)
        return found


def mean_mismatch(noisy):
    """Why a picture does not show the reference's scene, by its mean; None if the means agree."""
    off = abs(noisy["mean_ratio"] - 1)
    if off <= MAX_MEAN_DIFFERENCE + 2 * noisy["mean_ratio_error"]:
        return None
    ratio, noise = noisy["mean_ratio"], noisy["mean_ratio_error"]
    return f"not comparable: its mean is {ratio:.3f} of the reference's, of which {noise:.3f} may be noise"
