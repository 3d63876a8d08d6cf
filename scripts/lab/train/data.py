"""Renders the training data: views of random scenes, noisy stacks of bandwidth levels, and independent targets.

A view is a random scene of a family (families/) or a scene of scenes/, and for one or both methods a window of
SIDE x SIDE pixels of a picture of random width. Its folder has, for each method,

  METHOD-seedN.npz   arrays by snapshot (of ITERATIONS): levels, deviations, quarters, parts, finished, radius, albedo,
                     normal, depth
  sppm-bdpt2.npz     the same snapshots by bdpt, for the deep combiner: picture, quarters, deviation
  METHOD-target.npz  `halves`: two independent pictures without bias (bdpt), or with a bandwidth of less than a pixel
                     (vcm), where mirrors or glass show caustics

Radiance is multiplied by the exposure of the whole picture (normalise.py) and stored as float16, the targets as
float32. view.json describes the view, manifest.jsonl lists all finished views with the SHA-256 of their files. A
repeated run continues with the first file that is missing.
"""

import hashlib
import json
import math
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import OpenEXR

from . import families, normalise
from ..cache import Failed, load, program, run_timed, save
from ..commands import command
from ..record import ROOT

SIDE = 128
ITERATIONS = (8, 16, 32, 64, 128)
# Most views stop after 32 iterations, so that more views are rendered in the same time.
SHORT, LONG_SHARE, HELD_OUT_LONG_SHARE = 3, 1 / 8, 1 / 3
# Camera paths per pixel of the noisy stacks, by seed: the paper has two; one takes 0.6 times as long.
PATHS = {1: 2, 2: 1}
# Seed of the stack by sppm that the deep combiner reads.
DEEP_SEED = 2
LEVELS = 5
# Light paths of an iteration of sppm. The default, one for each pixel of the picture, takes twenty times as long in large
# pictures, of which a view shows a small window.
PHOTONS = 100_000
# Additive parts, in the order in which the arrays hold them.
PARTS = ("Emission", "Direct", "Indirect", "Caustic", "Volume")
# Least and greatest width of the picture of which a window is rendered. vcm traces one light path per camera path, so a
# window of a large picture would get too few of them; bdpt traces those of the whole picture, which takes long.
WIDTHS = {"sppm": (320, 1920), "vcm": (240, 480), "path": (320, 1920), "bdpt": (240, 320)}
# Methods of the noisy stacks of levels.
METHODS = ("sppm", "vcm")
# Largest stored value; the maximum of float16 is 65504.
LARGEST = 6e4
# Least share of the pixels that are not black, and attempts to find a scene with that.
LIT, ATTEMPTS = 0.5, 6
SCOUT_WIDTH = 160
BLENDER = ROOT / ".venv-bpy" / "bin" / "python"


class View:
    """One view: its name, family and folder."""

    def __init__(self, folder, family, index, scene=None):
        self.family, self.index, self.scene = family, index, scene
        self.name = f"{family}-{index}"
        self.folder = folder / "views" / self.name
        self.held_out = scene is not None or family in families.HELD_OUT
        share = HELD_OUT_LONG_SHARE if self.held_out else LONG_SHARE
        long = self.rng("iterations").random() < share
        self.iterations = ITERATIONS if long else ITERATIONS[:SHORT]
        # The first view of a family has a window by each method, others by one: more scenes are worth more than that.
        self.methods = list(METHODS) if index == 0 else [str(self.rng("method").choice(METHODS))]

    def rng(self, *words):
        """A random generator of the view."""
        return np.random.default_rng([self.index, *self.family.encode(), *(b for word in words for b in word.encode())])


def views(folder, count, view=View):
    """`count` views, of the class `view`, of every family and the scenes of scenes/, so that any first part of the list has
    all families."""
    files = [*sorted((ROOT / "scenes").glob("*.glb")), *sorted((ROOT / "scenes" / "second").glob("*.glb"))]
    found = []
    for index in range(count):
        found += [view(folder, family, index) for family in families.names()]
        found += [view(folder, f"scenes_{file.stem}", index, file) for file in files[index::count]]
    return found


def build_scene(family, index, attempt, scene):
    """Writes a random scene of a family."""
    path = os.pathsep.join(map(str, (ROOT / "scripts", ROOT / "scripts" / "blender")))
    draft = scene.with_name(f"{scene.stem}.part.glb")
    line = [BLENDER, "-m", "lab.train.families", family, index, attempt, draft]
    done = subprocess.run(list(map(str, line)), capture_output=True, text=True, env=os.environ | {"PYTHONPATH": path})
    if done.returncode or not draft.exists():
        raise Failed((done.stderr or done.stdout).strip()[-600:])
    draft.rename(scene)


def independent_file(method, seed):
    """The name of the file with the pictures by bdpt that the deep combiner reads beside a noisy stack."""
    return f"{method}-bdpt{seed}.npz"


class Maker:
    """Renders views. All of them use the same program, of which the folder of the data has a copy."""

    # Core-seconds of a target's half. Training averages over the noise of many targets, but errors on held-out views
    # are estimated from few.
    target_seconds, held_out_seconds = 2.0, 8.0

    def __init__(self, folder, binary):
        self.folder, self.binary = folder, folder / "caustique"
        folder.mkdir(parents=True, exist_ok=True)
        if not self.binary.exists():
            draft = folder / f"caustique.{os.getpid()}.part"
            shutil.copy2(binary, draft)
            draft.rename(self.binary)
            save(folder / "program.json", {"program": program(), "sha256": sha256(self.binary)})
        self.spent = 0.0

    def run(self, line):
        """Runs a command and adds up its core-seconds."""
        out, _, spent = run_timed(line, 3600)
        self.spent += spent
        return out

    def render(self, scene, out, **settings):
        """Renders with one thread; returns the channels of the EXR."""
        self.run(command("render", scene, "-o", out, program=self.binary, threads=1, progress="none", **settings))
        return channels_of(out)

    def make(self, view):
        """Renders what is missing of a view, and adds it to the manifest."""
        view.folder.mkdir(parents=True, exist_ok=True)
        work = view.folder / "work"
        work.mkdir(exist_ok=True)
        note = load(view.folder / "view.json") or self.scout(view, work)
        scene = view.scene or work / "scene.glb"
        if not scene.exists():
            build_scene(view.family, view.index, note["attempt"], scene)
        for method in view.methods:
            window = note["windows"][method]
            if not (view.folder / f"{method}-target.npz").exists():
                window["target"] = self.target(view, note, method, scene, work)
                self.store(view, note)
        self.noisy(view, note, scene, work)
        self.finish(view, work)

    def noisy(self, view, note, scene, work):
        """Renders the noisy stacks of a view that are missing."""
        for method in view.methods:
            for seed in PATHS:
                if not (view.folder / f"{method}-seed{seed}.npz").exists():
                    self.stacks(view, note, method, seed, scene, work)
                    self.store(view, note)
        deep = view.folder / independent_file("sppm", DEEP_SEED)
        if "sppm" in view.methods and not deep.exists():
            write(deep, self.independent(view, note, DEEP_SEED, scene, work))
            self.store(view, note)

    def finish(self, view, work):
        """Removes the temporary files of a view, and adds the others to the manifest."""
        shutil.rmtree(work)
        files = {file.name: sha256(file) for file in sorted(view.folder.iterdir())}
        line = json.dumps({"view": view.name, "family": view.family, "held_out": view.held_out, "files": files})
        with open(self.folder / "manifest.jsonl", "a", encoding="utf-8") as manifest:
            manifest.write(line + "\n")

    def store(self, view, note):
        """Writes view.json, with the core-seconds spent since the last time."""
        note["core_seconds"] = round(note["core_seconds"] + self.spent, 2)
        self.spent = 0.0
        save(view.folder / "view.json", note)

    def scout(self, view, work):
        """Chooses the scene and the windows of a view by a small quick picture; writes and returns view.json."""
        for attempt in range(1 if view.scene else ATTEMPTS):
            scene = view.scene or work / "scene.glb"
            if not view.scene:
                scene.unlink(missing_ok=True)
                build_scene(view.family, view.index, attempt, scene)
            settings = {"method": "sppm", "levels": LEVELS, "width": SCOUT_WIDTH, "iterations": 6, "no_finish": True}
            picture = self.render(scene, work / "scout.exr", **settings, no_checkpoint=True)
            levels = np.stack([rgb(picture, f"Level{k + 1}") for k in range(LEVELS)])
            if (levels[-1].mean(-1) > 0).mean() > LIT:
                break
        else:
            raise Failed("all attempts are dark")
        # With a method, the plan needs no pilot.
        line = command("plan", scene, program=self.binary, json=True, method="vcm")
        effects = json.loads(self.run(line))["effects"]
        simulated = {effect["name"]: effect["simulated"] for effect in effects}
        note = {
            "family": view.family,
            "index": view.index,
            "attempt": attempt,
            "scene_sha256": sha256(scene),
            "program": load(self.folder / "program.json"),
            "target_method": target_method(simulated),
            "windows": {method: window(view, method, levels) for method in WIDTHS},
            "core_seconds": 0.0,
        }
        note |= scales(picture, scene)
        self.store(view, note)
        return note

    def target(self, view, note, method, scene, work):
        """Renders both halves of the target of a window; returns their method and iterations."""
        words, halves, counts = target_options(note, method), [], []
        for half in (1, 2):
            out, saved = work / "half.exr", work / "half.saved"
            saved.unlink(missing_ok=True)
            settings = place(note, method) | words | {"no_finish": True, "layers": "beauty", "checkpoint": saved}
            settings["seed"] = 7000 + half
            self.render(scene, out, **settings, iterations=8)
            last = header_of(out)["history"][-1]
            seconds = self.held_out_seconds if view.held_out else self.target_seconds
            count = min(4 * math.ceil(2 * seconds / max(last["cpu_seconds"], 1e-3)), 8192)
            picture = self.render(scene, out, **settings, resume=saved, iterations=max(count, 16))
            halves.append(rgb(picture, "") * np.float32(note["exposure"]))
            counts.append(header_of(out)["history"][-1]["iterations"])
        write(view.folder / f"{method}-target.npz", {"halves": np.stack(halves)})
        return words | {"iterations": counts}

    def stacks(self, view, note, method, seed, scene, work):
        """Renders all snapshots of a window with one seed."""
        layers = ["beauty", "Level", "Variance", "Quarter", "albedo", "normal", "depth", *note["parts"]]
        radii = note["radii"] if method == "sppm" else ["Radius"]
        settings = place(note, method) | {"method": method, "levels": LEVELS, "eye_paths": PATHS[seed], "seed": seed}
        if method == "sppm":
            settings["photons"] = PHOTONS
        settings["layers"], height = ",".join([*layers, *radii]), settings["height"]
        arrays = self.snapshots(view, scene, work, settings, lambda picture: stack(picture, note, height, radii))
        write(view.folder / f"{method}-seed{seed}.npz", arrays)

    def independent(self, view, note, seed, scene, work):
        """All snapshots of the window of sppm by bdpt."""
        settings = place(note, "sppm") | {
            "method": "bdpt",
            "seed": 500 + seed,
            "no_finish": True,
            "layers": "beauty,Quarter",
        }

        arrays = lambda picture: independent_arrays(picture, note["exposure"])
        return self.snapshots(view, scene, work, settings, arrays)

    def snapshots(self, view, scene, work, settings, arrays):
        """Renders the iterations of a view, each continuing the one before; returns the arrays of all by name."""
        out, saved = work / "noisy.exr", work / "noisy.saved"
        saved.unlink(missing_ok=True)
        found = []
        for iterations in view.iterations:
            resume = saved if found else None
            picture = self.render(scene, out, **settings, checkpoint=saved, iterations=iterations, resume=resume)
            found.append(arrays(picture | {"iterations": iterations}))
        return {key: np.stack([one[key] for one in found]) for key in found[0]} | {
            "iterations": np.array(view.iterations)
        }


def sha256(path):
    """The SHA-256 of a file."""
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def write(path, arrays):
    """Writes arrays atomically, and without compression, so that training can map them into memory."""
    draft = path.with_name("part-" + path.name)
    np.savez(draft, **arrays)
    draft.rename(path)


def scales(picture, scene):
    """The scales of a picture, the vertical angle of its camera, and the layers that it has of those that vary."""
    levels = np.stack([rgb(picture, f"Level{k + 1}") for k in range(LEVELS)])
    return {
        "exposure": float(normalise.exposure(levels)),
        "depth": normalise.median_depth(picture["depth.Z"]),
        "yfov": vertical_angle(scene),
        "parts": [part for part in PARTS if f"{part}.R" in picture],
        "radii": [name for name in ("Radius", "CausticRadius") if f"{name}{LEVELS}.X" in picture],
    }


def channels_of(path):
    """The channels of an EXR by name."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    return {name: channel.pixels.astype(np.float32) for name, channel in channels.items()}


def header_of(path):
    """The JSON object that the program writes into an EXR's header."""
    return json.loads(OpenEXR.File(str(path), header_only=True).header()["caustique"])


def rgb(picture, layer):
    """A layer of colours, [h, w, 3]; the beauty has no name."""
    return np.stack([picture[f"{layer}.{c}" if layer else c] for c in "RGB"], -1)


def vertical_angle(scene):
    """The vertical angle of view in radians of the first camera of a .glb file."""
    data = scene.read_bytes()
    length = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + length])["cameras"][0]["perspective"]["yfov"]


def target_method(simulated):
    """Returns the options of the method that renders a reference picture: bdpt, which has no bias, or vcm with
    bandwidths below a pixel, which also finds the caustics seen in mirrors and through glass."""
    if not simulated.get("sds", True):
        return {"method": "bdpt"}
    return {"method": "vcm", "guide": "on", "alpha": 0.5}


def target_options(note, method):
    """The options of the target of a window. bdpt traces the light paths of the whole picture: fewer for each pixel of a
    large one, of which the window is a small part."""
    words, known = note["target_method"], note["windows"][method]
    if words["method"] != "bdpt":
        return words | {"levels": 1}
    share = 4 * SIDE**2 / (known["width"] * known["height"])
    return words | {"light_paths": min(max(round(16 * share), 1), 16) / 16}


def window(view, method, levels):
    """The width and height of the picture, and the window's corner: more likely where bandwidths differ."""
    rng = view.rng(method)
    small = levels.shape[1:3]
    width = 16 * round(math.exp(rng.uniform(*np.log(WIDTHS[method]))) / 16)
    height = round(width * small[0] / small[1])
    width, height = (max(SIDE, n) for n in (width, height))
    tone = np.log1p(normalise.finite(levels) * normalise.exposure(levels))
    spread = np.abs(tone[-1] - tone[0]).mean(-1) * ((levels[-1].mean(-1) > 0) + 1e-3)
    sums = np.pad(spread.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    corners, weights = [], []
    for y in np.unique(np.linspace(0, height - SIDE, 24).astype(int)):
        for x in np.unique(np.linspace(0, width - SIDE, 40).astype(int)):
            rows = np.clip(np.array([y, y + SIDE]) * small[0] / height, 0, small[0]).round().astype(int)
            columns = np.clip(np.array([x, x + SIDE]) * small[1] / width, 0, small[1]).round().astype(int)
            area = max((rows[1] - rows[0]) * (columns[1] - columns[0]), 1)
            total = (
                sums[rows[1], columns[1]]
                - sums[rows[0], columns[1]]
                - sums[rows[1], columns[0]]
                + sums[rows[0], columns[0]]
            )
            corners.append((int(x), int(y)))
            weights.append(0.01 + total / area)
    weights = np.array(weights) ** 3
    x, y = corners[rng.choice(len(corners), p=weights / weights.sum())]
    return {"width": width, "height": height, "corner": [x, y]}


def place(note, method):
    """The options of a window."""
    known = note["windows"][method]
    x, y = known["corner"]
    return {"width": known["width"], "height": known["height"], "crop": f"{x},{y},{SIDE},{SIDE}"}


def stack(picture, note, height, radii):
    """The arrays of a snapshot of a picture with this height, of which `picture` has the layers of a window."""
    scale = note["exposure"]
    bright = lambda layer: small(rgb(picture, layer) * scale)
    # The size of a pixel at the hit, in scene units; the largest bandwidths in pixels.
    pixel = picture["depth.Z"] * 2 * math.tan(note["yfov"] / 2) / height
    radius = [picture[f"{name}{LEVELS}.X"] / np.maximum(pixel, 1e-12) for name in radii]
    variances = [np.maximum(rgb(picture, f"Variance{k + 1}"), 0).mean(-1) for k in range(LEVELS)]
    black = np.zeros((*pixel.shape, 3), np.float16)
    depth = picture["depth.Z"] / note["depth"]
    return {
        "levels": np.stack([bright(f"Level{k + 1}") for k in range(LEVELS)]),
        "deviations": small(np.sqrt(np.stack(variances)) * scale),
        "quarters": np.stack([bright(f"Quarter{k + 1}") for k in range(4)]),
        "parts": np.stack([bright(part) if part in note["parts"] else black for part in PARTS]),
        "finished": bright(""),
        "radius": small(np.stack([radius[0], radius[-1]])),
        "albedo": small(rgb(picture, "albedo")),
        "normal": small(np.stack([picture[f"normal.{c}"] for c in "XYZ"], -1)),
        "depth": small(np.where(picture["depth.Z"] < normalise.BACKGROUND_DEPTH, depth, LARGEST)),
    }


def independent_arrays(picture, exposure):
    """The arrays of a snapshot by bdpt."""
    quarters = np.stack([rgb(picture, f"Quarter{k + 1}") for k in range(4)]) * exposure
    deviation = np.sqrt(quarters.var(0, ddof=1).mean(-1) / 4)
    return {"picture": small(rgb(picture, "") * exposure), "quarters": small(quarters), "deviation": small(deviation)}


def small(values):
    """Values as float16, clamped to what it can hold; values that are not finite become zero."""
    return np.nan_to_num(values, nan=0, posinf=LARGEST, neginf=-LARGEST).clip(-LARGEST, LARGEST).astype(np.float16)


def manifest(folder):
    """The lines of the manifest by the name of the view; a later line of a view replaces an earlier one."""
    file = Path(folder) / "manifest.jsonl"
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return {entry["view"]: entry for entry in map(json.loads, lines)}
