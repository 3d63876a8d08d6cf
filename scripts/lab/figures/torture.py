"""Renders one small scene for each feature of Blender's materials with Cycles and with caustique, and says where they
agree. Writes docs/lab/blender-table.md, unless only some features are asked for.

Pictures are kept in the cache folder under what they depend on, so that a run that was stopped goes on where it was.
Fails where a feature is wrong without a word.
"""

import hashlib
import inspect
import json
import os
import subprocess
import tempfile
from dataclasses import dataclass

import bpy  # First, because it brings the others.

import export
import numpy

from ..features import FEATURES, torture_stage
from ..options import options
from ..record import ROOT

VENV = ".venv-bpy"
TABLE = os.path.join(ROOT, "docs", "lab", "blender-table.md")
SIZE, TILES = 32, 4  # pixels a side, tiles a side
SAMPLES = 128  # a pixel, for each of two seeds
BAKE_SIZE = 256
MEAN, TILE = 0.02, 0.06  # relative differences that count as agreement
AGREES, BAKED, SAID, REFUSED, WRONG = "agrees", "agrees, baked", "approximated and said", "refused", "WRONG"
RANK = [AGREES, BAKED, SAID, REFUSED, WRONG]


@dataclass
class Result:
    """What became of a feature. `mean`: ours over Cycles', the channel that is farthest off; `tile`: the worst relative
    difference of a tile; `noise`: three standard errors of the mean, relative; `flip`: ours against Cycles'; `floor`:
    FLIP of Cycles' two renders, which differ by noise alone."""

    name: str
    verdict: str
    mean: float
    tile: float
    noise: float
    flip: float
    floor: float
    words: str


def cache():
    """Where pictures are kept between runs."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = os.path.join(base, "caustique", "torture")
    os.makedirs(folder, exist_ok=True)
    return folder


def program():
    """The program: $CAUSTIQUE_BIN, or the release build."""
    return os.environ.get("CAUSTIQUE_BIN", os.path.join(ROOT, "target", "release", "caustique"))


def _key(*parts):
    total = hashlib.sha256()
    for part in parts:
        total.update(part if isinstance(part, bytes) else repr(part).encode())
    return total.hexdigest()[:32]


def _bytes(path):
    with open(path, "rb") as file:
        return file.read()


def pixels(path):
    """An EXR's root R G B: (height, width, 3), first row at the bottom."""
    image = bpy.data.images.load(path)
    values = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(values)
    width, height = image.size
    channels = image.channels
    bpy.data.images.remove(image)
    return values.reshape(height, width, channels)[..., :3].astype(float)


def flip(picture, truth):
    """FLIP of a picture (height, width, 3) against another, by the program."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("picture.exr", "truth.exr")]
        for path, values in zip(paths, (picture, truth)):
            height, width, _ = values.shape
            image = bpy.data.images.new("judged", width, height, float_buffer=True, is_data=True)
            image.pixels.foreach_set(numpy.dstack([values, numpy.ones((height, width))]).astype(numpy.float32).ravel())
            image.file_format = "OPEN_EXR"
            image.save(filepath=path)
            bpy.data.images.remove(image)
        done = subprocess.run([program(), "compare", *paths, "--json"], capture_output=True, text=True, check=True)
        return json.loads(done.stdout)["flip"]


def by_cycles(seed):
    """The open scene rendered by Cycles without shortcuts."""
    scene = bpy.context.scene
    scene.render.engine, cycles = "CYCLES", scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", SAMPLES, seed
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = 64
    cycles.transparent_max_bounces = cycles.volume_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = cycles.light_sampling_threshold = 0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "cycles.exr")
        bpy.ops.render.render(write_still=True)
        return pixels(scene.render.filepath)


def by_caustique(scene, seed):
    """The .glb at `scene` path traced: the picture, and the warnings."""
    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "ours.exr")
        done = subprocess.run(
            [
                program(),
                "render",
                scene,
                "-o",
                picture,
                "--method",
                "path",
                "--iterations",
                str(SAMPLES),
                "--no-combine",
                "--width",
                str(SIZE),
                "--height",
                str(SIZE),
                "--seed",
                str(seed),
                "--layers",
                "beauty",
                "--progress",
                "none",
            ],
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        if done.returncode:
            raise RuntimeError(done.stderr.strip().splitlines()[-1])
        lines = [line.removeprefix("warning:") for line in done.stderr.splitlines() if line.startswith("warning:")]
        return pixels(picture), [line.replace(scene + ":", "").strip() for line in lines]


def _kept(key, render):
    """Two pictures of different seeds and the words of `render`, kept under a key."""
    path = os.path.join(cache(), key + ".npz")
    try:
        with numpy.load(path) as stored:
            return stored["a"], stored["b"], [str(w) for w in stored["words"]]
    except (OSError, ValueError, KeyError):
        pass
    (a, words), (b, _) = render(1), render(2)
    numpy.savez(path + ".tmp.npz", a=a, b=b, words=numpy.array(words, dtype=str))
    os.replace(path + ".tmp.npz", path)
    return a, b, words


def compare(ours, theirs):
    """(mean ratio, worst tile difference beyond noise, relative noise of the mean, whether they agree)."""
    (a, b), (c, d) = ours, theirs
    x, y = (a + b) / 2, (c + d) / 2
    variance = ((a - b) ** 2 + (c - d) ** 2) / 4
    mean, truth = x.mean((0, 1)), y.mean((0, 1))
    noise = 3 * numpy.sqrt(variance.sum((0, 1))) / SIZE**2 / truth
    ratio = mean / truth
    side = SIZE // TILES

    def tiles(z):
        return z.mean(2).reshape(TILES, side, TILES, side).mean((1, 3))

    spread = numpy.sqrt(tiles(variance) / side**2)  # channels are not independent: as if they were one
    scale = numpy.maximum(tiles(y), 0.05 * y.mean())
    off = numpy.abs(tiles(x) - tiles(y)) / scale
    beyond = off - 3 * spread / scale
    worst = int(numpy.argmax(numpy.abs(ratio - 1) - noise))
    agrees = bool(numpy.all(numpy.abs(ratio - 1) <= MEAN + noise) and numpy.all(beyond <= TILE))
    return float(ratio[worst]), float(off.flat[beyond.argmax()]), float(noise[worst]), agrees


def run(name, look=None):
    """The Result of one feature."""
    FEATURES[name](stage := torture_stage.Stage())
    bpy.context.view_layer.update()
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "scene.glb")
        said = export.write(path, bake_size=BAKE_SIZE)
        beside = [_bytes(os.path.join(folder, file)) for file in sorted(os.listdir(folder))]
        settings = (SIZE, SAMPLES, bpy.app.version_string)
        # What Cycles renders is the feature itself: its code, and the stage.
        told = [inspect.getsource(part) for part in (inspect.getmodule(FEATURES[name]), torture_stage)]
        theirs = _kept(_key("cycles", name, *told, settings), lambda seed: (by_cycles(seed), []))
        try:
            ours = _kept(_key("ours", settings, *beside, _bytes(program())), lambda seed: by_caustique(path, seed))
        except RuntimeError as error:
            return Result(name, REFUSED, 0.0, 0.0, 0.0, 0.0, 0.0, str(error))
    said = said + ours[2]
    if look:
        _show(os.path.join(look, name + ".png"), stage, theirs, ours)
    mean, tile, noise, agrees = compare(ours[:2], theirs[:2])
    baked = [line for line in said if "baked to" in line]
    losses = [line for line in said if line not in baked]
    verdict = (BAKED if baked else AGREES) if agrees else SAID if losses else WRONG
    judged = flip((ours[0] + ours[1]) / 2, (theirs[0] + theirs[1]) / 2), flip(theirs[0], theirs[1])
    return Result(name, verdict, mean, tile, noise, *judged, "; ".join(losses))


def _show(path, stage, theirs, ours):
    """Cycles' picture and ours side by side, and ten times their difference, each pixel as 6 x 6."""
    pair = [(p[0] + p[1]) / 2 for p in (theirs, ours)]
    pair = [p / max(1.0, float(numpy.percentile(pair[0], 98))) for p in pair]
    wide = numpy.concatenate([*pair, 0.2 + 5 * (pair[1] - pair[0])], axis=1).repeat(6, 0).repeat(6, 1)
    stored = numpy.clip(wide, 0, 1) ** (1 / 2.2)
    image = stage.image("look", stored)
    image.file_format = "PNG"
    image.save(filepath=path)


def rows():
    """The stored table: {feature: verdict}."""
    with open(TABLE, encoding="utf-8") as file:
        cells = [[c.strip() for c in line.split("|")[1:-1]] for line in file if line.startswith("| `")]
    return {row[0].strip("`"): row[1] for row in cells}


def _summary(what, results):
    """A sentence on the ratios of the means and on FLIP over some results."""
    ratios = numpy.array([r.mean for r in results])
    low, high = numpy.percentile(ratios, [5, 95])
    flips = numpy.array([r.flip for r in results])
    worst = results[int(flips.argmax())]
    return (
        f"- {what} ({len(results)}): mean {numpy.exp(numpy.log(ratios).mean()):.3f} ({low:.3f} to {high:.3f}); "
        f"FLIP {flips.mean():.3f},\n  median {numpy.median(flips):.3f}, worst {worst.flip:.3f} (`{worst.name}`)."
    )


def table(results):
    """The generated page."""
    counts = {verdict: sum(r.verdict == verdict for r in results) for verdict in RANK}
    lines = [
        "# What comes across from Blender, feature by feature",
        "",
        "<!-- Written by `scripts/lab.sh torture`; do not edit. -->",
        "",
        "Each row is a small scene with one feature, rendered by Cycles and, exported, by caustique (`--method path`):",
        f"{SIZE} x {SIZE} pixels, twice {SAMPLES} samples each. They agree where the mean of every channel is within "
        f"{MEAN:.0%} and every",
        f"tile of a sixteenth of the picture within {TILE:.0%}, three standard errors of noise allowed for. Images are "
        f"baked at",
        f"{BAKE_SIZE} x {BAKE_SIZE} texels.",
        "",
        f"{len(results)} features: " + ", ".join(f"{n} {v}" for v, n in counts.items()) + ".",
        "",
        "The mean is that of the channel that is farthest off; below it is the geometric mean of the features, with",
        "the 5th to the 95th percentile. FLIP is the mean over the pixels of the difference that an eye sees, from 0 to",
        f"1, noise included: two renders by Cycles of {SAMPLES} samples each differ by "
        f"{numpy.mean([r.floor for r in results]):.3f} in the mean.",
        "",
    ]
    rendered = [r for r in results if r.verdict != REFUSED]
    lines += [
        _summary("all that is rendered", rendered),
        _summary("what agrees", [r for r in rendered if r.verdict in (AGREES, BAKED)]),
        "",
    ]
    lines += [
        "| feature | verdict | mean, ours / Cycles | its noise | worst tile | FLIP | what the export and the render say |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in results:
        words = r.words.replace('material "tested": ', "").replace("|", "/")
        lines.append(
            f"| `{r.name}` | {r.verdict} | {r.mean:.3f} | {r.noise:.3f} | {r.tile:.1%} | {r.flip:.3f} | {words} |"
        )
    return "\n".join(lines) + "\n"


def add_arguments(parser):
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=sorted(FEATURES), help="these features")
    parser.add_argument("--look", metavar="FOLDER", help="also a PNG of both pictures beside each other")


def main():
    if options.look:
        os.makedirs(options.look, exist_ok=True)
    results = []
    for name in options.only or FEATURES:
        result = run(name, options.look)
        results.append(result)
        print(
            f"{result.verdict:22} {name:34} mean {result.mean:.3f} +- {result.noise:.3f}  tile {result.tile:6.1%}  "
            f"flip {result.flip:.3f}  {result.words[:150]}",
            flush=True,
        )
    if not options.only:
        with open(TABLE, "w", encoding="utf-8") as file:
            file.write(table(results))
    return int(any(r.verdict == WRONG for r in results))
