"""Two independent unbiased halves of a reference per scene, kept for all programs: light transport is what it is.

--reference-seconds are core-seconds of a half. A half that has spent four fifths of them is taken, whichever program
rendered it; reference.json beside says which.
"""

import math

from . import twins
from .cache import BIN, CACHE, load, making, program, save, scene_key, timed
from .options import options
from .reading import read
from .record import ROOT

ARGUMENTS = {"set": "first", "scenes": None, "width": 320, "threads": 2, "reference_seconds": 240.0}
# What share of the reference's seconds is enough for a half that is there: iterations take now more, now less.
ENOUGH = 0.8
# What converges soonest and finds all light without bias, where that is known. Merging (vcm) has a bias that vanishes.
SURELY = {"blocks": ["bdpt"], "interior": ["bdpt"], "stadium": ["vcm", "--guide", "on"]}
# A bulb seen through fluted glass has a bright sample in hundreds, whatever the method.
LONGER = {"lamp": 2}
SETS = {"first": ["scenes"], "second": ["scenes/second"], "all": ["scenes", "scenes/second"], "twins": []}


def scenes():
    """The scenes asked for, as paths: those of the set, or those that --scenes names (second/NAME, twin/NAME)."""
    if options.set not in SETS:
        raise SystemExit(f"--set {options.set} is not one of {', '.join(SETS)}")
    if options.scenes:
        found = [path(name) for name in options.scenes]
        missing = [file for file in found if not file.exists()]
        if missing:
            raise SystemExit(f"{missing[0]} is not there: --scenes names files below scenes without .glb")
        return found
    found = [file for folder in SETS[options.set] or SETS["all"] for file in sorted((ROOT / folder).glob("*.glb"))]
    return found if options.set != "twins" else [file for file in map(twins.twin, found) if file]


def path(text):
    """The file of a scene by its name in tables."""
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
        return f"twin/{scene.stem}"
    return scene.relative_to(ROOT / "scenes").with_suffix("").as_posix()


def method(scene):
    """The method of a scene's reference, with options: merging where caustics are seen in mirrors or through glass."""
    known = name(scene).removeprefix("twin/")
    if known in SURELY:
        return SURELY[known]
    effects = {effect["name"]: effect["simulated"] for effect in read("plan", str(scene))["effects"]}
    return ["vcm"] if effects.get("sds", True) else ["bdpt"]


def seconds(scene):
    """Core-seconds of a half."""
    return options.reference_seconds * LONGER.get(name(scene).removeprefix("twin/"), 1)


def folder(scene):
    """Where a scene's halves lie: half1.exr, half2.exr, reference.json."""
    return CACHE / "references" / scene_key(scene) / f"{options.width}"


def reference(scene):
    """Makes a scene's halves if they are missing or too short; returns their folder and what is known about them."""
    where = folder(scene)
    known = load(where / "reference.json")
    if known and min(known["core_seconds"]) >= ENOUGH * seconds(scene):
        return where, known
    known = {
        "scene": name(scene),
        "width": options.width,
        "program": program(),
        "options": [],
        "iterations": [],
        "core_seconds": [],
    }
    known["options"] = ["--method", *method(scene), "--levels", "1", "--no-combine", "--layers", "beauty"]
    with making(where) as draft:
        for half in (1, 2):
            file = draft / f"half{half}.exr"
            command = [
                BIN,
                "render",
                scene,
                "-o",
                file,
                *known["options"],
                "--width",
                options.width,
                "--seed",
                7770 + half,
                "--threads",
                options.threads,
            ]
            # Clocks of a busy machine say little: a short render tells how many iterations it takes.
            stop = ["--time", f"{max(0.05 * seconds(scene) / options.threads, 1):.3f}"]
            for _ in range(3):
                timed([*command, *stop, "--progress", "none"])
                last = read("info", str(file))["history"][-1]
                if last["cpu_seconds"] >= ENOUGH * seconds(scene):
                    break
                stop = ["--iterations", math.ceil(last["iterations"] * seconds(scene) / max(last["cpu_seconds"], 1e-3))]
            known["iterations"].append(last["iterations"])
            known["core_seconds"].append(round(last["cpu_seconds"], 2))
        save(draft / "reference.json", known)
    return where, known
