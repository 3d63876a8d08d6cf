"""Render training crops: noisy stacks of levels and their references.

  python -m lab.train.data --caustique target/release/caustique -o DIR scenes/*.glb

Each scene is varied as in [Choi and Moon 2021, 4.3]: the camera is moved, rotated and zoomed, materials and lights are
scaled. Variant 0 is the unchanged scene, which training does not use. Each variant is rendered once with many iterations
for the reference, and --renders times with few, with different seeds. The number of photons per iteration is random,
around the papers' 100,000 for 1280 x 720, in proportion to the pixels, so that small pictures have the density of large
ones. A zoom by z multiplies it by z^2, as for a crop of a picture z times as wide. A repeated command continues: finished
variants are skipped.

The reference is the mean of two renders with a small bandwidth (k = 5, six times the photons). Half of their difference
is its noise, which references.jsonl stores as a relMSE. Because its bandwidth is not zero, it has a part of the small
bias of Level1.
"""

import argparse
import json
import math
import pathlib
import struct
import subprocess
import sys

import numpy as np
import OpenEXR

from . import crops
from . import normalise
from ..commands import command

PAPER_PHOTONS_PER_PIXEL = 100_000 / (1280 * 720)
# Photons per pixel of references, relative to the papers.
REFERENCE_DENSITY = 6
REFERENCE_KNN = 5


def read_glb(path):
    data = path.read_bytes()
    magic, _, _ = struct.unpack_from("<III", data)
    if magic != 0x46546C67:
        raise SystemExit(f"{path}: not a .glb file")
    length, _ = struct.unpack_from("<II", data, 12)
    return json.loads(data[20 : 20 + length]), data[20 + length :]


def write_glb(path, scene, rest):
    text = json.dumps(scene).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<IIIII", 0x46546C67, 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    path.write_bytes(header + text + rest)


def quaternion(axis, angle):
    axis = np.asarray(axis) / np.linalg.norm(axis)
    return np.append(axis * math.sin(angle / 2), math.cos(angle / 2))


def multiply(a, b):
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return np.array(
        [
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        ]
    )


def rotate(q, v):
    return multiply(multiply(q, np.append(v, 0)), q * [-1, -1, -1, 1])[:3]


def vary(scene, rng, folder):
    """Change the cameras, surfaces and relative light strengths of a glTF scene in place; returns the cameras' zoom."""
    zoom = float(np.exp(rng.uniform(0, np.log(3))))
    for camera in scene.get("cameras", []):
        if "perspective" in camera:
            half = math.tan(camera["perspective"]["yfov"] / 2)
            camera["perspective"]["yfov"] = 2 * math.atan(half / zoom)
    for node in scene.get("nodes", []):
        if "camera" in node and "matrix" not in node:
            turn = np.array(node.get("rotation", [0, 0, 0, 1]), float)
            move = np.array(node.get("translation", [0, 0, 0]), float)
            reach = 0.04 * np.linalg.norm(move)
            node["translation"] = list(move + rotate(turn, rng.normal(0, [reach, reach, 1.5 * reach])))
            # The camera's own axes: x pitches, y yaws, z rolls.
            for axis, degrees in (([1, 0, 0], 5), ([0, 1, 0], 8), ([0, 0, 1], 4)):
                turn = multiply(turn, quaternion(axis, math.radians(rng.normal(0, degrees))))
            node["rotation"] = list(turn / np.linalg.norm(turn))
    for material in scene.get("materials", []):
        pbr = material.setdefault("pbrMetallicRoughness", {})
        colour = np.array(pbr.get("baseColorFactor", [1, 1, 1, 1]), float)
        transmits = "KHR_materials_transmission" in material.get("extensions", {})
        # Clear glass stays clear, and smooth glass smooth: that is what makes caustics.
        if not transmits:
            colour[:3] = np.clip(colour[:3] * rng.uniform(0.5, 1.3, 3), 0, 1)
            pbr["baseColorFactor"] = list(colour)
            if rng.random() < 0.3:
                pbr["roughnessFactor"] = float(rng.uniform(0, 1))
        strength = material.get("extensions", {}).get("KHR_materials_emissive_strength")
        if strength:
            strength["emissiveStrength"] = strength.get("emissiveStrength", 1) * float(np.exp(rng.normal(0, 0.7)))
    for light in scene.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        light["intensity"] = light.get("intensity", 1) * float(np.exp(rng.normal(0, 0.7)))
    for one in scene.get("scenes", []):
        environment = one.get("extras", {}).get("caustique", {}).get("environment", {})
        if "file" in environment:
            environment["file"] = str((folder / environment["file"]).resolve())
    return zoom


def render(args, scene, out, **options):
    """Render by sppm without a finish; returns whether the program succeeded, and prints its error."""
    size = {"width": args.width, "height": args.height, "threads": args.threads or None}
    words = ["render", scene, "-o", out]
    line = command(*words, program=args.caustique, method="sppm", **size, **options, no_finish=True, progress="none")
    done = subprocess.run(line, capture_output=True, text=True)
    if done.returncode != 0:
        print(f"{scene.name}: {done.stderr.strip()}", file=sys.stderr)
    return done.returncode == 0


def layers(path, names):
    """Layers of an EXR as {name: [h, w, channels]}, by names such as Level1.RGB; RGB is the beauty."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    get = lambda layer, c: channels[f"{layer}.{c}" if layer else c].pixels.astype(np.float32)
    return {
        name: np.stack([get(name.split(".")[0] if "." in name else "", c) for c in name.split(".")[-1]], -1)
        for name in names
    }


def read_stack(path, levels):
    colour = [f"Level{k + 1}.RGB" for k in range(levels)]
    variance = [f"Variance{k + 1}.RGB" for k in range(levels)]
    data = layers(path, [*colour, *variance, "albedo.RGB", "normal.XYZ", "depth.Z"])
    return {
        "levels": np.stack([data[n] for n in colour]),
        "variances": np.stack([data[n] for n in variance]),
        "albedo": data["albedo.RGB"],
        "normal": data["normal.XYZ"],
        "depth": data["depth.Z"][..., 0],
    }


def boxes(stack, side, count, rng):
    """Random crops, with a higher probability where the levels differ."""
    _, h, w, _ = stack["levels"].shape
    side = min(side, h, w) // 4 * 4
    corners = [
        (y, x)
        for y in range(rng.integers(h % side + 1), h - side + 1, side)
        for x in range(rng.integers(w % side + 1), w - side + 1, side)
    ]
    scale = normalise.exposure(stack["levels"])
    spread = np.abs(np.diff(np.log1p(np.maximum(normalise.finite(stack["levels"])[[0, -1]] * scale, 0)), axis=0)).mean(
        (0, -1)
    )
    weight = np.array([0.05 + spread[y : y + side, x : x + side].mean() for y, x in corners])
    chosen = rng.choice(len(corners), min(count, len(corners)), replace=False, p=weight / weight.sum())
    return [(*corners[k], side) for k in chosen]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path, help=".glb files")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--caustique", default="caustique", help="the program")
    parser.add_argument(
        "--variants", type=int, nargs="+", default=list(range(6)), help="numbers of variants; 0 is the unchanged scene"
    )
    parser.add_argument("--renders", type=int, default=6, help="number of noisy renders per variant")
    parser.add_argument(
        "--iterations",
        type=int,
        nargs="+",
        default=[16, 32, 64, 128, 256],
        help="iterations of the noisy renders, in turn",
    )
    parser.add_argument(
        "--reference-iterations", type=int, default=4096, help="total iterations of the two reference renders"
    )
    parser.add_argument("--threads", type=int, default=0, help="threads of the program; 0 uses all cores")
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--height", type=int, default=256)
    parser.add_argument("--levels", type=int, default=5)
    parser.add_argument("--side", type=int, default=128, help="pixels of a crop's side; 0 stores whole pictures")
    parser.add_argument("--crops", type=int, default=3, help="number of crops per noisy render")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def varied_scene(args, path, varied, exr, rng, tries=8):
    """Write a variant whose picture is not black (a camera may move into a wall); returns its zoom, or None."""
    for _ in range(tries):
        scene, rest = read_glb(path)
        zoom = vary(scene, rng, path.parent)
        write_glb(varied, scene, rest)
        if render(args, varied, exr, levels=1, layers="beauty", iterations=4, photons=2000):
            if (layers(exr, ["RGB"])["RGB"] > 0).mean() > 0.6:
                return zoom
    print(f"{path.stem}: {tries} variants were black", file=sys.stderr)
    return None


def variant(args, path, index):
    """Render a variant of a scene and write its crops; returns their number, or None if there is no reference."""
    rng = np.random.default_rng([args.seed, index, *path.stem.encode()])
    work = args.output / "work"
    work.mkdir(parents=True, exist_ok=True)
    exr = work / f"{path.stem}-{index}.exr"
    varied, zoom = path, 1.0
    if index:
        varied = work / f"{path.stem}-{index}.glb"
        zoom = varied_scene(args, path, varied, exr, rng)
        if zoom is None:
            return None
    photons = lambda density: max(1000, round(density * PAPER_PHOTONS_PER_PIXEL * zoom**2 * args.width * args.height))
    halves = []
    settings = {"levels": 1, "knn": REFERENCE_KNN, "layers": "beauty", "photons": photons(REFERENCE_DENSITY)}
    settings["iterations"] = args.reference_iterations // 2
    for half in range(2):
        if not render(args, varied, exr, **settings, seed=10_000 + 2 * index + half):
            return None
        halves.append(layers(exr, ["RGB"])["RGB"])
    reference = (halves[0] + halves[1]) / 2
    noise = np.mean(((halves[0] - reference) ** 2).mean(-1) / (reference.mean(-1) ** 2 + 0.01))
    note = {
        "scene": path.stem,
        "variant": index,
        "iterations": args.reference_iterations,
        "relmse": round(float(noise), 6),
    }
    with open(args.output / "references.jsonl", "a") as log:
        log.write(json.dumps(note) + "\n")
    count = 0
    for k in range(args.renders):
        density = np.exp(rng.uniform(np.log(0.5), np.log(2))) if index else 1.0
        iterations = args.iterations[k % len(args.iterations)]
        settings = {"levels": args.levels, "layers": "all", "iterations": iterations, "photons": photons(density)}
        if not render(args, varied, exr, **settings, seed=1000 * index + k + 1):
            continue
        stack = read_stack(exr, args.levels) | {"reference": reference}
        parts = boxes(stack, args.side, args.crops, rng) if args.side else [None]
        for n, box in enumerate(parts):
            count += crops.save(args.output / f"{path.stem}--{index}-{iterations}-{k}-{n}.npz", stack, box)
    exr.unlink(missing_ok=True)
    return count


def main():
    args = arguments()
    args.output.mkdir(parents=True, exist_ok=True)
    for index in args.variants:
        for path in args.scenes:
            done = args.output / "work" / f"{path.stem}-{index}.done"
            if not done.exists():
                count = variant(args, path, index)
                if count is None:
                    continue
                done.touch()
                print(f"{path.stem}, variant {index}: {count} crops", flush=True)


if __name__ == "__main__":
    main()
