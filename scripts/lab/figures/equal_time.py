"""Every method on equal scenes for equal time: relMSE against a reference, and the cost of paths.

The reference of a scene is the mean of two long renders by the method (REFERENCES) that finds all light soonest. Their
difference gives the reference's own error, which is subtracted from every figure; figures that are not well above it are
marked. Seconds are wall-clock seconds on all cores, without the start of the renderer.
"""

import subprocess

import numpy as np
import OpenEXR

from ..commands import command, read
from ..options import options
from ..record import ROOT, record

ARGUMENTS = {
    "scenes": ["cornell", "interior"],
    "seconds": 15.0,
    "reference_seconds": 240.0,
    "width": 160,
    "seeds": 2,
}
OUT = ROOT / "out" / "equal_time"

#: Options of the reference by scene; others use vertex connection and merging.
REFERENCES = {"interior": ["--method", "bdpt"]}

#: Name, options, and the layer to compare ("" is the finished picture).
METHODS = [
    ("path", ["--method", "path"], "Noisy"),
    ("light", ["--method", "light"], "Noisy"),
    ("bdpt", ["--method", "bdpt"], "Noisy"),
    ("pm", ["--method", "pm"], "Noisy"),
    ("sppm, one level", ["--method", "sppm", "--levels", "1"], "Noisy"),
    ("cppm, one level", ["--method", "cppm", "--levels", "1"], "Noisy"),
    ("sppm, combined", ["--method", "sppm"], ""),
    ("bpm", ["--method", "bpm"], "Noisy"),
    ("vcm", ["--method", "vcm", "--levels", "1"], "Noisy"),
    ("vcm, combined", ["--method", "vcm", "--levels", "5"], ""),
]


def render(scene, out, seconds, seed, words):
    """Renders for a time; returns the header."""
    settings = {"width": options.width, "time": seconds, "seed": seed, "progress": "plain"}
    subprocess.run(command("render", scene, "-o", out, *words, **settings), check=True, stderr=subprocess.DEVNULL)
    return read("info", out)


def picture(path, layer):
    """The colours of a layer as float64 of shape (height, width, 3)."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        names = [f"{layer}.{c}" if layer else c for c in "RGB"]
        return np.stack([channels[name].pixels.astype(np.float64) for name in names], axis=-1)


def relmse(image, reference):
    """relMSE as `caustique compare` computes it, over all pixels and without the worst 0.5 %."""
    pixels = ((image - reference) ** 2 / (reference**2 + 0.01)).mean(axis=-1).ravel()
    keep = np.sort(pixels)[: len(pixels) - int(0.005 * len(pixels))]
    return np.array([pixels.mean(), keep.mean()])


def add_arguments(parser):
    parser.add_argument("--keep", action="store_true", help="use existing references")


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for scene in options.scenes:
        file = ROOT / "scenes" / f"{scene}.glb"
        halves = []
        for seed in (1001, 1002):
            half = OUT / f"{scene}-reference-{seed}.exr"
            words = REFERENCES.get(scene, ["--method", "vcm", "--levels", "1"])
            if not (options.keep and half.exists()):
                render(file, half, options.reference_seconds, seed, [*words, "--no-finish"])
            halves.append(picture(half, "Noisy"))
        reference = (halves[0] + halves[1]) / 2
        # The variance of the mean is a quarter of the squared difference of the halves.
        own = relmse(halves[0], halves[1]) / 4
        size = f"{reference.shape[1]} x {reference.shape[0]}"
        print(f"{scene}, {size}, {options.seconds:g} s each; the reference's own relMSE is {own[0]:.2g}")
        costs = f"{'core-s per million light paths':>33}{'camera paths':>14}"
        print(f"{'':<18}{'iterations':>11}{'relMSE':>11}{'trimmed':>11}{costs}")
        rows = []
        for name, words, layer in METHODS:
            errors, infos = [], []
            for seed in range(options.seeds):
                out = OUT / f"{scene}-{name.replace(', ', '-').replace(' ', '-')}.exr"
                infos.append(
                    render(file, out, options.seconds, seed, words if layer != "Noisy" else [*words, "--no-finish"])
                )
                errors.append(relmse(picture(out, layer), reference))
            error = np.mean(errors, axis=0) - own
            last = infos[-1]["history"][-1]
            pairs = 2 if infos[-1]["arguments"]["levels"] != 1 and name.split(",")[0] in ("sppm", "vcm") else 1
            camera_paths = reference.shape[0] * reference.shape[1] * last["iterations"] * pairs
            costs = [last["cpu_seconds"] / n * 1e6 if n else None for n in (last["light_paths"], camera_paths)]
            marks = ["" if e > 3 * o else "*" for e, o in zip(error, own)]
            shown = "".join(f"{f'{e:.3g}{mark}':>11}" for e, mark in zip(error, marks))
            light, camera = ("-" if c is None else f"{c:.2f}" for c in costs)
            print(f"{name:<18}{last['iterations']:>11}{shown}{light:>33}{camera:>14}", flush=True)
            rows.append(
                {
                    "method": name,
                    "iterations": last["iterations"],
                    "relmse": error[0],
                    "trimmed": error[1],
                    "core_s_per_million_light_paths": costs[0],
                    "core_s_per_million_eye_paths": costs[1],
                }
            )
        print("* not well above the reference's own error\n")
        settings = {"scene": scene, "seconds": options.seconds, "width": options.width}
        record("equal-time", {**settings, "reference_relmse": own[0], "methods": rows})
