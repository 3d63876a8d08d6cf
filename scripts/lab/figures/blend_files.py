"""Renders the .blend files of a folder by Cycles and by caustique, and compares them as `torture` does. Writes
docs/lab/blend-files.md. Files without a camera are seen from a corner; files without a lamp, too, get a grey world.

Fails if a file differs without a warning, or cannot be exported.
"""

import glob
import os
import tempfile
import time
from dataclasses import dataclass

import bpy  # First, because it brings the others.

import export
from mathutils import Vector

from ..options import options
from ..record import ROOT
from . import torture

VENV = ".venv-bpy"
TABLE = os.path.join(ROOT, "docs", "lab", "blend-files.md")
SLOWEST = 10  # files whose seconds of export the page gives
_EPSILON = 1e-7  # radiance added to both pictures, for channels that are black in both
_SOLID = {"MESH", "CURVE", "FONT", "META", "SURFACE"}
AGREES, WARNED, WRONG = "agrees", "differs, warned", "DIFFERS"


@dataclass
class Result:
    """The comparison of a file. `mean` and `tile` as for `torture.Result`; `seconds` of the export."""

    name: str
    verdict: str
    mean: float
    tile: float
    seconds: float
    words: str


def _see(scene):
    """Give a scene a camera that sees all objects, and a world if it has no lamp."""
    bpy.context.view_layer.update()
    solids = [thing for thing in scene.objects if thing.type in _SOLID]
    corners = [thing.matrix_world @ Vector(at) for thing in solids for at in thing.bound_box]
    corners += [thing.matrix_world.translation for thing in scene.objects if thing.instance_type != "NONE"]
    corners = corners or [Vector((-1, -1, -1)), Vector((1, 1, 1))]
    middle = sum(corners, Vector()) / len(corners)
    reach = max((corner - middle).length for corner in corners) or 1.0
    camera = bpy.data.cameras.new("added")
    camera.clip_start, camera.clip_end = 1e-3 * reach, 1e3 * reach
    scene.camera = bpy.data.objects.new("added", camera)
    scene.collection.objects.link(scene.camera)
    away = Vector((0.8, -1.2, 0.7)).normalized()
    scene.camera.location = middle + away * reach * 3.2
    scene.camera.rotation_euler = away.to_track_quat("Z", "Y").to_euler()
    if not any(thing.type == "LIGHT" for thing in scene.objects):
        world = scene.world = bpy.data.worlds.new("added")
        if bpy.app.version < (5, 0, 0):
            world.use_nodes = True
        background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (0.5, 0.6, 0.7, 1)
    bpy.context.view_layer.update()


def run(path):
    """The Result of one file."""
    bpy.ops.wm.open_mainfile(filepath=path, load_ui=False, use_scripts=False)
    scene, render = bpy.context.scene, bpy.context.scene.render
    render.engine, render.use_border, render.use_compositing, render.film_transparent = "CYCLES", False, False, False
    render.resolution_x = render.resolution_y = torture.SIZE
    render.resolution_percentage, render.pixel_aspect_x, render.pixel_aspect_y = 100, 1, 1
    if scene.camera is None:
        _see(scene)
    with tempfile.TemporaryDirectory() as folder:
        exported, began = os.path.join(folder, "scene.glb"), time.perf_counter()
        warnings = export.write(exported, bake_size=torture.BAKE_SIZE)
        seconds = time.perf_counter() - began
        ours = [torture.by_caustique(exported, seed) for seed in (1, 2)]
    theirs = [torture.by_cycles(seed) + _EPSILON for seed in (1, 2)]
    mean, tile, _, agrees = torture.compare([picture + _EPSILON for picture, _ in ours], theirs)
    words = [line for line in warnings + ours[0][1] if "baked to" not in line]
    verdict = AGREES if agrees else WARNED if words else WRONG
    return Result(os.path.basename(path), verdict, mean, tile, seconds, "; ".join(dict.fromkeys(words)))


def table(results):
    """The generated page."""
    counts = "; ".join(f"{v}: {sum(r.verdict == v for r in results)}" for v in (AGREES, WARNED, WRONG))
    slowest = sorted(results, key=lambda r: -r.seconds)[:SLOWEST]
    lines = [
        "# Public files of Blender, compared with Cycles",
        "",
        "<!-- Written by `scripts/lab.sh blend_files FOLDER`; do not edit. -->",
        "",
        "The files are the scenes of the tests of Blender's glTF exporter",
        "([KhronosGroup/glTF-Blender-IO](https://github.com/KhronosGroup/glTF-Blender-IO)), rendered in Blender",
        f"{bpy.app.version_string} at {torture.SIZE} x {torture.SIZE} pixels and compared as in the "
        "[table of features](blender-table.md). Files without a camera are",
        "seen from a corner; if they have no lamp either, a grey world lights them. Many have no images, which were not "
        "public.",
        "",
        f"Verdicts of {len(results)} files: {counts}.",
        "",
        "| file that differs | mean, ours / Cycles | worst tile | warnings of export and render |",
        "| --- | --- | --- | --- |",
    ]
    for r in results:
        if r.verdict != AGREES:
            lines.append(f"| `{r.name}` | {r.mean:.3f} | {r.tile:.1%} | {r.words.replace('|', '/')} |")
    lines += ["", "| slowest exports | seconds |", "| --- | --- |"]
    lines += [f"| `{r.name}` | {r.seconds:.1f} |" for r in slowest]
    return "\n".join(lines) + "\n"


def add_arguments(parser):
    parser.add_argument("folder", metavar="FOLDER", help="folder of .blend files")


def main():
    results, failed = [], 0
    for path in sorted(glob.glob(os.path.join(options.folder, "*.blend"))):
        try:
            result = run(path)
        except Exception as error:  # any fault of a file from anywhere: the next one is tried
            failed += 1
            print(f"{os.path.basename(path)}: {type(error).__name__}: {error}", flush=True)
            continue
        results.append(result)
        print(
            f"{result.verdict:16} {result.name:50} mean {result.mean:.3f}  tile {result.tile:6.1%}  export "
            f"{result.seconds:.1f} s  {result.words[:100]}",
            flush=True,
        )
    with open(TABLE, "w", encoding="utf-8") as file:
        file.write(table(results))
    return int(failed > 0 or any(r.verdict == WRONG for r in results))
