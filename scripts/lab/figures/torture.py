"""Renders one small scene for each feature of Blender's materials by Cycles and by caustique, and compares them. Writes
docs/lab/blender-table.md, unless --only selects features; with --update then only their rows.

Pictures are cached under a key of their inputs, so that an interrupted run continues. Fails if a feature differs without
a warning.
"""

import hashlib
import inspect
import json
import os
import re
import subprocess
import tempfile
from dataclasses import dataclass

import bpy  # First, because it brings the others.

import export
import numpy

from ..commands import command
from ..features import FEATURES, torture_stage
from ..options import options
from ..record import ROOT

VENV = ".venv-bpy"
TABLE = os.path.join(ROOT, "docs", "lab", "blender-table.md")
SIZE, TILES = 32, 4  # pixels and tiles of a side of the picture
SAMPLES = 128  # per pixel, for each of two seeds
BAKE_SIZE = 256
MEAN, TILE = 0.02, 0.06  # relative differences that count as agreement
AGREES, BAKED, WARNED, REFUSED, WRONG = "agrees", "agrees, baked", "approximated, warned", "refused", "WRONG"
RANK = [AGREES, BAKED, WARNED, REFUSED, WRONG]


@dataclass
class Result:
    """The comparison of a feature. `mean`: our mean over Cycles', of the channel with the largest difference; `tile`: the
    largest relative difference of a tile; `noise`: three relative standard errors of the mean; `flip`: FLIP between the
    pictures; `floor`: FLIP between Cycles' two renders, which differ only by noise."""

    name: str
    verdict: str
    mean: float
    tile: float
    noise: float
    flip: float
    floor: float
    words: str


def cache():
    """The folder that keeps pictures between runs."""
    base = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = os.path.join(base, "caustique", "torture")
    os.makedirs(folder, exist_ok=True)
    return folder


def program():
    """The path of the program: $CAUSTIQUE_BIN, or the release build."""
    return os.environ.get("CAUSTIQUE_BIN", os.path.join(ROOT, "target", "release", "caustique"))


def _key(*parts):
    total = hashlib.sha256()
    for part in parts:
        total.update(part if isinstance(part, bytes) else repr(part).encode())
    return total.hexdigest()[:32]


def _bytes(path):
    with open(path, "rb") as file:
        return file.read()


def pixels(path, behind=None):
    """The root layer of an EXR, of shape (height, width, 3), with the first row at the bottom. `behind`: a picture over
    which it is composited by its alpha."""
    image = bpy.data.images.load(path)
    values = numpy.empty(len(image.pixels), numpy.float32)
    image.pixels.foreach_get(values)
    width, height = image.size
    channels = image.channels
    bpy.data.images.remove(image)
    values = values.reshape(height, width, channels).astype(float)
    return values[..., :3] if behind is None else values[..., :3] + (1 - values[..., 3:4]) * behind


def flip(picture, truth):
    """FLIP of a picture (height, width, 3) against another one, computed by the program."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [os.path.join(folder, name) for name in ("picture.exr", "truth.exr")]
        for path, values in zip(paths, (picture, truth)):
            height, width, _ = values.shape
            image = bpy.data.images.new("compared", width, height, float_buffer=True, is_data=True)
            image.pixels.foreach_set(numpy.dstack([values, numpy.ones((height, width))]).astype(numpy.float32).ravel())
            image.file_format = "OPEN_EXR"
            image.save(filepath=path)
            bpy.data.images.remove(image)
        done = subprocess.run([program(), "compare", *paths, "--json"], capture_output=True, text=True, check=True)
        return json.loads(done.stdout)["flip"]


def by_cycles(seed, behind=None):
    """Renders the open scene by Cycles, without clamping or limits on bounces below 64, over the picture `behind`."""
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
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    settings.color_mode = "RGB" if behind is None else "RGBA"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "cycles.exr")
        bpy.ops.render.render(write_still=True)
        return pixels(scene.render.filepath, behind)


def backdrop(stage):
    """Cycles' picture of the stage without its body: the photograph behind a picture with a transparent film."""
    empty = [(stage.body, "hide_render", True), (stage.scene.render, "film_transparent", False)]
    empty.append((stage.floor, "is_shadow_catcher", False))
    before = [getattr(thing, name) for thing, name, _ in empty]
    for thing, name, value in empty:
        setattr(thing, name, value)
    try:
        return by_cycles(3)
    finally:
        for (thing, name, _), value in zip(empty, before):
            setattr(thing, name, value)


def by_caustique(scene, seed, behind=None):
    """Renders the .glb at `scene` by path tracing; returns the picture, over the one `behind`, and the warnings."""
    with tempfile.TemporaryDirectory() as folder:
        picture = os.path.join(folder, "ours.exr")
        settings = {"method": "path", "iterations": SAMPLES, "no_finish": True, "width": SIZE, "height": SIZE}
        settings |= {"seed": seed, "layers": "beauty", "progress": "none"}
        line = command("render", scene, "-o", picture, program=program(), **settings)
        done = subprocess.run(line, capture_output=True, text=True, timeout=600, check=False)
        if done.returncode:
            raise RuntimeError(done.stderr.strip().splitlines()[-1])
        lines = [line.removeprefix("warning:") for line in done.stderr.splitlines() if line.startswith("warning:")]
        return pixels(picture, behind), [line.replace(scene + ":", "").strip() for line in lines]


def _cached(key, render):
    """Two pictures of `render` with different seeds and its warnings, from the cache if it has the key."""
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
    """(mean ratio, largest tile difference beyond noise, relative noise of the mean, whether the pictures agree)."""
    (a, b), (c, d) = ours, theirs
    x, y = (a + b) / 2, (c + d) / 2
    variance = ((a - b) ** 2 + (c - d) ** 2) / 4
    mean, truth = x.mean((0, 1)), y.mean((0, 1))
    noise = 3 * numpy.sqrt(variance.sum((0, 1))) / SIZE**2 / truth
    ratio = mean / truth
    side = SIZE // TILES

    def tiles(z):
        return z.mean(2).reshape(TILES, side, TILES, side).mean((1, 3))

    spread = numpy.sqrt(tiles(variance) / side**2)  # Channels are not independent, so they count as one.
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
        warnings = export.write(path, bake_size=BAKE_SIZE)
        beside = [_bytes(os.path.join(folder, file)) for file in sorted(os.listdir(folder))]
        settings = (SIZE, SAMPLES, bpy.app.version_string)
        # Cycles' picture depends on the code of the feature and of the stage.
        sources = [inspect.getsource(part) for part in (inspect.getmodule(FEATURES[name]), torture_stage)]
        behind = backdrop(stage) if stage.scene.render.film_transparent else None
        theirs = _cached(_key("cycles", name, *sources, settings), lambda seed: (by_cycles(seed, behind), []))
        key = _key("ours", settings, *beside, _bytes(program()), *(() if behind is None else sources))
        try:
            ours = _cached(key, lambda seed: by_caustique(path, seed, behind))
        except RuntimeError as error:
            return Result(name, REFUSED, 0.0, 0.0, 0.0, 0.0, 0.0, str(error))
    warnings = warnings + ours[2]
    if look:
        _show(os.path.join(look, name + ".png"), stage, theirs, ours)
    mean, tile, noise, agrees = compare(ours[:2], theirs[:2])
    baked = [line for line in warnings if "baked to" in line]
    losses = [line for line in warnings if line not in baked]
    verdict = (BAKED if baked else AGREES) if agrees else WARNED if losses else WRONG
    flips = flip((ours[0] + ours[1]) / 2, (theirs[0] + theirs[1]) / 2), flip(theirs[0], theirs[1])
    return Result(name, verdict, mean, tile, noise, *flips, "; ".join(dict.fromkeys(losses)))


def _show(path, stage, theirs, ours):
    """Writes Cycles' picture, ours and five times their difference side by side, each pixel enlarged to 6 x 6."""
    pair = [(p[0] + p[1]) / 2 for p in (theirs, ours)]
    pair = [p / max(1.0, float(numpy.percentile(pair[0], 98))) for p in pair]
    wide = numpy.concatenate([*pair, 0.2 + 5 * (pair[1] - pair[0])], axis=1).repeat(6, 0).repeat(6, 1)
    stored = numpy.clip(wide, 0, 1) ** (1 / 2.2)
    image = stage.image("look", stored)
    image.file_format = "PNG"
    image.save(filepath=path)


def _cells():
    with open(TABLE, encoding="utf-8") as file:
        return [[cell.strip() for cell in line.split("|")[1:-1]] for line in file if line.startswith("| `")]


def rows():
    """The verdicts of the stored table, by feature."""
    return {row[0].strip("`"): row[1] for row in _cells()}


def named():
    """The features of the stored table with warnings, also those whose pictures agree."""
    return {row[0].strip("`") for row in _cells() if row[-1]}


def stored():
    """The results of the stored table. `floor` is the mean of all."""
    with open(TABLE, encoding="utf-8") as file:
        floor = float(re.search(r"samples each differ by ([0-9.]+)", file.read()).group(1))
    numbers = ((row, float(row[2]), float(row[4].rstrip("%")) / 100, float(row[3]), float(row[5])) for row in _cells())
    return [
        Result(row[0].strip("`"), row[1], mean, tile, noise, shown, floor, row[6])
        for row, mean, tile, noise, shown in numbers
    ]


def _summary(title, results):
    """A list item with the ratios of the means and FLIP of some results."""
    ratios = numpy.array([r.mean for r in results])
    low, high = numpy.percentile(ratios, [5, 95])
    flips = numpy.array([r.flip for r in results])
    worst = results[int(flips.argmax())]
    return (
        f"- {title} ({len(results)}): mean {numpy.exp(numpy.log(ratios).mean()):.3f} ({low:.3f} to {high:.3f}); "
        f"FLIP {flips.mean():.3f},\n  median {numpy.median(flips):.3f}, worst {worst.flip:.3f} (`{worst.name}`)."
    )


def table(results):
    """The generated page."""
    counts = {verdict: sum(r.verdict == verdict for r in results) for verdict in RANK}
    lines = [
        "# Features of Blender's materials, compared with Cycles",
        "",
        "<!-- Written by `scripts/lab.sh torture`; do not edit. -->",
        "",
        "Each row is a small scene with one feature, rendered by Cycles and, after the export, by caustique (`--method",
        f"path`), at {SIZE} x {SIZE} pixels with two seeds of {SAMPLES} samples each. The pictures agree if, within three "
        f"standard",
        f"errors of noise, the mean of every channel differs by at most {MEAN:.0%} and every tile (a sixteenth of the "
        f"picture) by at",
        f"most {TILE:.0%}. Images are baked at {BAKE_SIZE} x {BAKE_SIZE} texels.",
        "",
        f"Verdicts of {len(results)} features: " + "; ".join(f"{v}: {n}" for v, n in counts.items()) + ".",
        "",
        "The mean is the ratio of the channel with the largest difference. FLIP is the visible difference from 0 to 1,",
        f"averaged over the pixels, including noise: two renders by Cycles of {SAMPLES} samples each differ by "
        f"{numpy.mean([r.floor for r in results]):.3f} on",
        "average. Over the features, the lists below give the geometric mean of the ratios with its 5th and 95th",
        "percentile, and FLIP.",
        "",
    ]
    rendered = [r for r in results if r.verdict != REFUSED]
    lines += [
        _summary("all rendered features", rendered),
        _summary("features that agree", [r for r in rendered if r.verdict in (AGREES, BAKED)]),
        "",
    ]
    lines += [
        "| feature | verdict | mean, ours / Cycles | noise of the mean | worst tile | FLIP | warnings of export and render |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in results:
        words = r.words.replace('material "tested": ', "").replace("|", "/")
        lines.append(
            f"| `{r.name}` | {r.verdict} | {r.mean:.3f} | {r.noise:.3f} | {r.tile:.1%} | {r.flip:.3f} | {words} |"
        )
    return "\n".join(lines) + "\n"


def add_arguments(parser):
    parser.add_argument(
        "--only", nargs="+", metavar="NAME", choices=sorted(FEATURES), help="compare only these features"
    )
    parser.add_argument("--update", action="store_true", help="with --only: write the rows of these features")
    parser.add_argument("--look", metavar="FOLDER", help="also write a PNG of both pictures side by side")


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
    if options.only and options.update:
        new = {result.name: result for result in results}
        known = {result.name: result for result in stored()}
        results = [new.get(name) or known[name] for name in FEATURES if name in new or name in known]
    if not options.only or options.update:
        with open(TABLE, "w", encoding="utf-8") as file:
            file.write(table(results))
    return int(any(r.verdict == WRONG for r in results))
