"""Make training crops by rendering: noisy stacks of levels and their references.

  python data.py --caustique ../../target/release/caustique -o DIR ../../scenes/*.glb

Each scene is varied --variants times (camera moved and turned, materials and lights scaled; the first variant is the scene
itself), as [Choi and Moon 2021, 4.3] do. Each variant is rendered once with many iterations for the reference and
--renders times with few, each with a seed of its own. Photons an iteration are drawn per pixel, around the papers' 100,000 for
1280 x 720, so that small pictures have the density of large ones. Run again to go on: finished variants are skipped.
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

import crops
import normalise

PAPER_PHOTONS_PER_PIXEL = 100_000 / (1280 * 720)


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
    return np.array([
        aw * bx + ax * bw + ay * bz - az * by, aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw, aw * bw - ax * bx - ay * by - az * bz,
    ])


def rotate(q, v):
    return multiply(multiply(q, np.append(v, 0)), q * [-1, -1, -1, 1])[:3]


def vary(scene, rng, folder):
    """Change a glTF scene in place: where cameras stand and look, surfaces, and lights against each other."""
    for node in scene.get("nodes", []):
        if "camera" in node and "matrix" not in node:
            turn = np.array(node.get("rotation", [0, 0, 0, 1]), float)
            move = np.array(node.get("translation", [0, 0, 0]), float)
            reach = 0.15 * np.linalg.norm(move)
            node["translation"] = list(move + rotate(turn, rng.normal(0, [reach, reach, 1.5 * reach])))
            # The camera's own axes: x pitches, y yaws, z rolls.
            for axis, degrees in (([1, 0, 0], 8), ([0, 1, 0], 12), ([0, 0, 1], 4)):
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


def render(args, scene, out, *options):
    size = ["--width", str(args.width), "--height", str(args.height)]
    command = [args.caustique, "render", str(scene), "-o", str(out), "--no-combine", "--progress", "none", *size, *options]
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True)
    if done.returncode != 0:
        print(f"{scene.name}: {done.stderr.strip()}", file=sys.stderr)
    return done.returncode == 0


def layers(path, names):
    """{name: [h, w, channels]} of layers such as Level1.RGB; the beauty is RGB alone."""
    channels = OpenEXR.File(str(path), separate_channels=True).channels()
    get = lambda layer, c: channels[f"{layer}.{c}" if layer else c].pixels.astype(np.float32)
    return {name: np.stack([get(name.split(".")[0] if "." in name else "", c) for c in name.split(".")[-1]], -1) for name in names}


def read_stack(path, levels):
    colour = [f"Level{k + 1}.RGB" for k in range(levels)]
    variance = [f"Variance{k + 1}.RGB" for k in range(levels)]
    data = layers(path, [*colour, *variance, "albedo.RGB", "normal.XYZ", "depth.Z"])
    return {
        "levels": np.stack([data[n] for n in colour]), "variances": np.stack([data[n] for n in variance]),
        "albedo": data["albedo.RGB"], "normal": data["normal.XYZ"], "depth": data["depth.Z"][..., 0],
    }


def boxes(stack, side, count, rng):
    """Crops where levels disagree or the reference has structure, more often than where all is smooth."""
    _, h, w, _ = stack["levels"].shape
    side = min(side, h, w) // 4 * 4
    corners = [(y, x) for y in range(rng.integers(h % side + 1), h - side + 1, side)
               for x in range(rng.integers(w % side + 1), w - side + 1, side)]
    scale = normalise.exposure(stack["levels"])
    spread = np.abs(np.diff(np.log1p(np.maximum(normalise.finite(stack["levels"])[[0, -1]] * scale, 0)), axis=0)).mean((0, -1))
    weight = np.array([0.05 + spread[y : y + side, x : x + side].mean() for y, x in corners])
    chosen = rng.choice(len(corners), min(count, len(corners)), replace=False, p=weight / weight.sum())
    return [(*corners[k], side) for k in chosen]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path, help=".glb files")
    parser.add_argument("-o", "--output", type=pathlib.Path, required=True)
    parser.add_argument("--caustique", default="caustique", help="the program")
    parser.add_argument("--variants", type=int, default=5)
    parser.add_argument("--renders", type=int, default=6, help="noisy renders of each variant")
    parser.add_argument("--iterations", type=int, nargs="+", default=[16, 32, 64, 128, 256], help="of noisy renders, in turn")
    parser.add_argument("--reference-iterations", type=int, default=4096)
    parser.add_argument("--reference-method", default="sppm")
    parser.add_argument("--width", type=int, default=384)
    parser.add_argument("--height", type=int, default=256)
    parser.add_argument("--levels", type=int, default=5)
    parser.add_argument("--side", type=int, default=128, help="of crops")
    parser.add_argument("--crops", type=int, default=3, help="of each noisy render")
    parser.add_argument("--seed", type=int, default=1)
    return parser.parse_args()


def variant(args, path, index):
    """Render one variant of a scene and write its crops; returns how many, or None without a reference."""
    rng = np.random.default_rng([args.seed, index, *path.stem.encode()])
    work = args.output / "work"
    work.mkdir(parents=True, exist_ok=True)
    scene, rest = read_glb(path)
    if index:
        vary(scene, rng, path.parent)
    varied = path
    if index:
        varied = work / f"{path.stem}-{index}.glb"
        write_glb(varied, scene, rest)
    pixels = args.width * args.height
    photons = lambda density: str(max(1000, round(density * pixels)))
    exr = work / "picture.exr"
    density = max(1.0, PAPER_PHOTONS_PER_PIXEL)
    if not render(args, varied, exr, "--method", args.reference_method, "--levels", "1", "--layers", "beauty",
                  "--iterations", args.reference_iterations, "--photons", photons(density), "--seed", 10_000 + index):
        return None
    reference = layers(exr, ["RGB"])["RGB"]
    count = 0
    for k in range(args.renders):
        density = PAPER_PHOTONS_PER_PIXEL * np.exp(rng.uniform(np.log(0.5), np.log(6)))
        seed = 1000 * index + k + 1
        if not render(args, varied, exr, "--method", "sppm", "--levels", args.levels, "--layers", "all", "--seed", seed,
                      "--iterations", args.iterations[k % len(args.iterations)], "--photons", photons(density)):
            continue
        stack = read_stack(exr, args.levels) | {"reference": reference}
        for n, box in enumerate(boxes(stack, args.side, args.crops, rng)):
            count += crops.save(args.output / f"{path.stem}--{index}-{k}-{n}.npz", stack, box)
    return count


def main():
    args = arguments()
    args.output.mkdir(parents=True, exist_ok=True)
    for index in range(args.variants):
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
