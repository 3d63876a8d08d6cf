"""References: two independent halves per scene, without bias or with a bias that vanishes. All versions of the program
share them.

--reference-seconds are the core-seconds of a half. A stored half is used if it has at least four fifths of them;
reference.json names the program that rendered it.
"""

import math
from pathlib import Path

from . import twins
from .cache import CACHE, create, frame_suffix, load, outside, program, run_timed, save, scene_key
from .commands import command, read
from .options import options
from .record import ROOT
from .train import families
from .train.data import build_scene

ARGUMENTS = {"set": "first", "scenes": None, "width": 320, "threads": 2, "reference_seconds": 240.0}
# Least share of the reference's core-seconds for a stored half, because times of iterations vary.
MIN_SHARE = 0.8
# Distance of the seeds of the two halves of a frame.
FRAME_SEEDS = 10_000
# The method that converges fastest and finds all light, where it is known. vcm has a bias that vanishes.
METHODS = {"blocks": ["bdpt"], "interior": ["bdpt"], "stadium": ["vcm", "--guide", "on"]}
# Factors of the core-seconds. A bulb seen through fluted glass has one bright sample in hundreds with every method.
TIME_FACTORS = {"lamp": 2}
SETS = {"first": ["scenes"], "second": ["scenes/second"], "all": ["scenes", "scenes/second"], "twins": [], "random": []}
# The random scene of each family in the set "random", far from those of training.
RANDOM_INDEX = 1000


def scenes():
    """The paths of the selected scenes: those of --set, or those that --scenes names (NAME, second/NAME, twin/NAME,
    PATH.glb)."""
    if options.set not in SETS:
        raise SystemExit(f"--set {options.set} is not one of {', '.join(SETS)}")
    if options.scenes:
        found = [path(name) for name in options.scenes]
        missing = [file for file in found if not file.exists()]
        if missing:
            raise SystemExit(f"{missing[0]} does not exist: --scenes names files below scenes, without .glb, or paths")
        return found
    if options.set == "random":
        return [random_scene(family) for family in families.names()]
    found = [file for folder in SETS[options.set] or SETS["all"] for file in sorted((ROOT / folder).glob("*.glb"))]
    return found if options.set != "twins" else [file for file in map(twins.twin, found) if file]


def random_scene(family):
    """The file of a random scene of a family of the training data, which Blender writes once."""
    file = CACHE / "random-scenes" / f"{family}.glb"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        build_scene(family, RANDOM_INDEX, 0, file)
    return file


def path(text):
    """The file of a scene, by its path or by the scene's name in tables."""
    if text.endswith(".glb"):
        return Path(text).resolve()
    if not text.startswith("twin/"):
        return ROOT / "scenes" / f"{text}.glb"
    originals = [ROOT / folder / f"{text[5:]}.glb" for folder in SETS["all"]]
    originals = [original for original in originals if original.exists()]
    if not originals:
        raise SystemExit(f"--scenes {text}: there is no scene of that name")
    return twins.twin(originals[0]) or originals[0]


def name(scene):
    """A scene's name in tables."""
    if not scene.is_relative_to(ROOT / "scenes"):
        return f"{outside(scene)}/{scene.stem}"
    return scene.relative_to(ROOT / "scenes").with_suffix("").as_posix()


def method(scene):
    """The method of a scene's reference, with its options: vcm if caustics are seen in mirrors or through glass."""
    known = name(scene).removeprefix("twin/").removeprefix("shot/")
    if known in METHODS:
        return METHODS[known]
    effects = {effect["name"]: effect["simulated"] for effect in read("plan", str(scene), "--method", "vcm")["effects"]}
    return ["vcm"] if effects.get("sds", True) else ["bdpt"]


def seconds(scene):
    """Core-seconds of a half of a scene's reference."""
    return options.reference_seconds * TIME_FACTORS.get(name(scene).removeprefix("twin/"), 1)


def folder(scene, frame=None):
    """The folder of the halves of a scene, or of a frame of it: half1.exr, half2.exr, reference.json."""
    return CACHE / "references" / scene_key(scene) / f"{options.width}{frame_suffix(frame)}"


def reference(scene, frame=None):
    """Renders the halves of a scene, or of a frame of it, if they are missing or too short; returns their folder and
    the value of reference.json."""
    where = folder(scene, frame)
    known = load(where / "reference.json")
    if known and min(known["core_seconds"]) >= MIN_SHARE * seconds(scene):
        return where, known
    known = {
        "scene": name(scene),
        "width": options.width,
        "program": program(),
        "options": [],
        "iterations": [],
        "core_seconds": [],
    }
    known["options"] = ["--method", *method(scene), "--levels", "1", "--no-finish", "--layers", "beauty"]
    with create(where) as draft:
        for half in (1, 2):
            file = draft / f"half{half}.exr"
            # The program adds a frame's number to its seed; no half may have the seed of a half of another frame.
            seed = 7770 + half * (1 if frame is None else FRAME_SEEDS)
            settings = {"width": options.width, "seed": seed, "threads": options.threads, "progress": "none"}
            settings["frames"] = frame
            line = command("render", scene, "-o", file, *known["options"], **settings)
            # Clocks mislead on a busy machine, so a short render measures the core-seconds of an iteration.
            stop = ["--time", f"{max(0.05 * seconds(scene) / options.threads, 1):.3f}"]
            for _ in range(3):
                run_timed([*line, *stop])
                last = read("info", file)["history"][-1]
                if last["cpu_seconds"] >= MIN_SHARE * seconds(scene):
                    break
                stop = ["--iterations", math.ceil(last["iterations"] * seconds(scene) / max(last["cpu_seconds"], 1e-3))]
            known["iterations"].append(last["iterations"])
            known["core_seconds"].append(round(last["cpu_seconds"], 2))
        save(draft / "reference.json", known)
    return where, known
