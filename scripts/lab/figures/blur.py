"""Motion blur: the cost of a moment, and the error of blurred renders beside still ones.

Two scenes are generated in out/blur. `objects` has a million still triangles and ten balls of glass that move;
`deforming` has a sheet of a hundred thousand triangles that a morph target bends. The cost of a moment is the difference
of core-seconds between renders of many and of few iterations of 8 x 8 pixels, beside the same frame without blur. The
error is that of 64 iterations, which the program estimates, with and without blur. Methods agree if their blurred
pictures have equal means.
"""

import json
import math

import numpy as np

from ..cache import run_timed
from ..commands import command, read
from ..options import options
from ..record import ROOT, record

ARGUMENTS = {"width": 120, "iterations": 64}
OUT = ROOT / "out" / "blur"
METHODS = ["path", "bdpt", "vcm", "sppm", "cppm"]
SHUTTER = "-0.25,0.25"
# Number of moments by which the cost of one is measured.
MOMENTS = 256


class Scene:
    """A glTF file in memory."""

    def __init__(self):
        self.bytes = bytearray()
        self.document = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [
                {"nodes": [], "extras": {"caustique": {"frame_rate": 24, "environment": {"color": [0.1, 0.1, 0.1]}}}}
            ],
            "animations": [{"channels": [], "samplers": []}],
        }

    def add(self, kind, item):
        self.document.setdefault(kind, []).append(item)
        return len(self.document[kind]) - 1

    def array(self, values, component=5126):
        values = np.ascontiguousarray(values, np.float32 if component == 5126 else np.uint32)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": values.nbytes}
        self.bytes += values.tobytes()
        shape = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}[values.shape[1] if values.ndim > 1 else 1]
        accessor = {"bufferView": self.add("bufferViews", view), "componentType": component, "type": shape}
        return self.add("accessors", {**accessor, "count": len(values)})

    def mesh(self, points, triangles, material, target=None):
        primitive = {
            "attributes": {"POSITION": self.array(points)},
            "indices": self.array(triangles.reshape(-1), 5125),
            "material": material,
        }
        if target is not None:
            primitive["targets"] = [{"POSITION": self.array(target)}]
        return self.add("meshes", {"primitives": [primitive]})

    def node(self, **item):
        self.document["scenes"][0]["nodes"].append(self.add("nodes", item))
        return self.document["scenes"][0]["nodes"][-1]

    def move(self, node, path, values):
        """Animates a value from frame 0 to frame 2."""
        animation = self.document["animations"][0]
        sampler = {"input": self.array(np.array([0.0, 2 / 24])), "output": self.array(np.array(values))}
        animation["samplers"].append(sampler)
        animation["channels"].append(
            {"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}}
        )

    def write(self, name):
        OUT.mkdir(parents=True, exist_ok=True)
        self.document["buffers"] = [{"uri": f"{name}.bin", "byteLength": len(self.bytes)}]
        (OUT / f"{name}.bin").write_bytes(self.bytes)
        (OUT / f"{name}.gltf").write_text(json.dumps(self.document), encoding="utf-8")
        return OUT / f"{name}.gltf"


def sheet(side, height, extent=4.0):
    """A square grid of `2 side^2` triangles around the origin, with its heights."""
    axis = np.linspace(-extent, extent, side + 1)
    x, z = np.meshgrid(axis, axis, indexing="ij")
    points = np.stack([x, height(x, z), z], -1).reshape(-1, 3)
    at = np.arange((side + 1) ** 2).reshape(side + 1, side + 1)
    a, b, c, d = (part.reshape(-1) for part in (at[:-1, :-1], at[1:, :-1], at[:-1, 1:], at[1:, 1:]))
    return points, np.concatenate([np.stack([a, c, b], -1), np.stack([b, c, d], -1)])


def ball(rows=32):
    """A closed ball of radius 1, of about `4 rows^2` triangles."""
    columns = 2 * rows
    angles = [(math.pi * i / rows, 2 * math.pi * j / columns) for i in range(1, rows) for j in range(columns)]
    points = [[0.0, 1.0, 0.0]] + [
        [math.sin(t) * math.cos(p), math.cos(t), math.sin(t) * math.sin(p)] for t, p in angles
    ]
    points.append([0.0, -1.0, 0.0])
    ring = lambda i, j: 1 + (i - 1) * columns + j % columns
    triangles = []
    for j in range(columns):
        triangles += [[0, ring(1, j + 1), ring(1, j)], [len(points) - 1, ring(rows - 1, j), ring(rows - 1, j + 1)]]
        for i in range(1, rows - 1):
            triangles += [
                [ring(i, j), ring(i, j + 1), ring(i + 1, j)],
                [ring(i, j + 1), ring(i + 1, j + 1), ring(i + 1, j)],
            ]
    return np.array(points), np.array(triangles)


def base(scene):
    """Adds a lamp, a camera and three materials to a scene; returns the materials."""
    matte = {"baseColorFactor": [0.6, 0.6, 0.6, 1.0], "metallicFactor": 0.0}
    grey = scene.add("materials", {"pbrMetallicRoughness": matte, "doubleSided": True})
    glass = {
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0},
        "extensions": {
            "KHR_materials_transmission": {"transmissionFactor": 1.0},
            "KHR_materials_volume": {"thicknessFactor": 1.0},
            "KHR_materials_ior": {"ior": 1.5},
        },
    }
    glass = scene.add("materials", glass)
    glow = {"emissiveFactor": [1, 1, 1], "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 60.0}}}
    glow = scene.add("materials", {**glow, "doubleSided": True})
    points, triangles = sheet(1, lambda x, z: 0 * x + 5.0, 0.3)
    scene.node(name="lamp", mesh=scene.mesh(points, triangles, glow))
    camera = {"type": "perspective", "perspective": {"yfov": 0.8, "aspectRatio": 1.0, "znear": 0.1}}
    camera = scene.add("cameras", camera)
    scene.node(
        name="camera", camera=camera, translation=[0, 4.5, 5.5], rotation=[-math.sin(0.34), 0, 0, math.cos(0.34)]
    )
    return grey, glass


def objects():
    scene = Scene()
    grey, glass = base(scene)
    ground = sheet(708, lambda x, z: 0.05 * np.sin(9 * x) * np.sin(7 * z))
    scene.node(name="ground", mesh=scene.mesh(*ground, grey))
    mesh = scene.mesh(*ball(), glass)
    for i in range(10):
        x, z = 0.9 * (i % 5) - 1.8, 1.5 * (i // 5) - 1.0
        node = scene.node(name=f"ball {i}", mesh=mesh, scale=[0.35] * 3)
        scene.move(node, "translation", [[x - 0.4, 0.6, z], [x + 0.4, 0.6, z + 0.2]])
    return scene.write("objects")


def deforming():
    scene = Scene()
    grey, _ = base(scene)
    scene.node(name="ground", mesh=scene.mesh(*sheet(8, lambda x, z: 0 * x - 1.0), grey))
    points, triangles = sheet(224, lambda x, z: 0.2 * np.sin(3 * x), 2.0)
    target = np.stack([0 * points[:, 0], 0.6 * np.cos(2 * points[:, 2]), 0 * points[:, 0]], -1)
    node = scene.node(name="sheet", mesh=scene.mesh(points, triangles, grey, target))
    scene.move(node, "weights", [0.0, 1.0])
    return scene.write("deforming")


def render(scene, name, **more):
    """Renders frame 1; returns the core-seconds of the process and the file."""
    file = OUT / f"{name}.exr"
    line = command("render", scene, "-o", file, frames=1, threads=1, progress="none", no_finish=True, **more)
    _, _, spent = run_timed(line, 3600)
    return spent, file


def cost(scene):
    """Core-seconds of a moment, with blur and without."""
    few, many = 2, 2 + MOMENTS
    found = []
    for shutter in (SHUTTER, "0"):
        run = lambda iterations, shutter=shutter: render(
            scene, "cost", shutter=shutter, width=8, height=8, iterations=iterations, method="path"
        )[0]
        found.append((run(many) - run(few)) / MOMENTS)
    return found


def main():
    scenes = {"objects": objects(), "deforming": deforming()}
    values = {"width": options.width, "iterations": options.iterations, "cost_ms": {}, "methods": {}}
    print(f"{'scene':<10} {'moment':>9} {'still':>9}")
    for name, scene in scenes.items():
        moment, still = (1e3 * seconds for seconds in cost(scene))
        values["cost_ms"][name] = {"moment": moment - still, "iteration": still}
        print(f"{name:<10} {moment - still:>6.1f} ms {still:>6.1f} ms")
    print(f"\n{'method':<8} {'blurred':>9} {'still':>9} {'mean ratio to bdpt':>19}")
    size = {"width": options.width, "height": options.width, "iterations": options.iterations, "seed": 1}
    files = {}
    for method in METHODS:
        errors = []
        for shutter in (SHUTTER, "0"):
            _, file = render(scenes["objects"], f"{method}{shutter}", shutter=shutter, method=method, **size)
            errors.append(read("info", file)["error"])
            files.setdefault(method, file)
        values["methods"][method] = {"blurred": errors[0], "still": errors[1]}
    for method, found in values["methods"].items():
        found["mean_ratio"] = read("compare", files[method], files["bdpt"])["mean_ratio"]
        print(f"{method:<8} {found['blurred']:>9.4f} {found['still']:>9.4f} {found['mean_ratio']:>19.4f}")
    record("blur", values)
