"""Seconds and core-seconds of scripts/blender/export.py for 1,000 balls of 1,280 triangles in ten materials, half of them
glass: balls that share ten meshes, and balls with one mesh each. The fastest of --rounds counts.
"""

import contextlib
import math
import os
import sys
import tempfile
import time

import bpy  # First, because it brings the others.

import bmesh
import export

from .. import rocks
from ..options import options
from ..record import record

VENV = ".venv-bpy"
ARGUMENTS = {"rounds": 3}
OBJECTS, KINDS, SIDE = 1000, 10, 10


def material(index):
    """A Principled material whose colour depends on the index, and which is glass if the index is odd."""
    return rocks.material(f"kind {index}", Base_Color=(0.2 + 0.05 * index, 0.5, 0.4, 1), Transmission_Weight=index % 2)


def ball(material):
    """A ball's mesh of 1,280 triangles."""
    form = bmesh.new()
    form.loops.layers.uv.new("UVMap")
    bmesh.ops.create_icosphere(form, subdivisions=4, radius=0.4, calc_uvs=True)
    mesh = bpy.data.meshes.new("ball")
    form.to_mesh(mesh)
    form.free()
    mesh.shade_smooth()
    mesh.materials.append(material)
    return mesh


def build(meshes):
    """Builds a cube of balls that share `meshes` meshes, a camera and a sun; returns the number of triangles."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    kinds = [material(index) for index in range(KINDS)]
    shapes = [ball(kinds[index % KINDS]) for index in range(meshes)]
    for i in range(OBJECTS):
        rocks.put(f"ball {i}", shapes[i % meshes], (i % SIDE, i // SIDE % SIDE, i // SIDE**2))
    scene.camera = rocks.put("eye", bpy.data.cameras.new("eye"), (5, -20, 5), (math.pi / 2, 0, 0))
    rocks.put("sun", bpy.data.lights.new("sun", "SUN"), (0, 0, 20))
    return sum(len(thing.data.polygons) for thing in scene.objects if thing.type == "MESH")


def main():
    print(f"{'meshes':>6} {'triangles':>10} {'seconds':>8} {'core-s':>7} {'MB':>6}", file=sys.stderr)
    for name, meshes in (("shared", KINDS), ("unshared", OBJECTS)):
        triangles, times, cores = build(meshes), [], []
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "scene.glb")
            for _ in range(options.rounds):
                began, spent = time.perf_counter(), time.process_time()
                with contextlib.redirect_stdout(None):
                    export.write(path)
                times.append(time.perf_counter() - began)
                cores.append(time.process_time() - spent)
            size = os.path.getsize(path)
        print(f"{meshes:>6} {triangles:>10} {min(times):>8.2f} {min(cores):>7.2f} {size / 1e6:>6.1f}", file=sys.stderr)
        record(
            "export",
            {
                "scene": name,
                "objects": OBJECTS,
                "meshes": meshes,
                "triangles": triangles,
                "seconds": min(times),
                "core_seconds": min(cores),
                "bytes": size,
                "blender": bpy.app.version_string,
            },
        )
