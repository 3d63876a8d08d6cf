"""Every method on the same scenes for the same time: relMSE against a reference, and what paths cost.

The reference of a scene is the mean of two long renders by the method in REFERENCES that finds all its light soonest. Their difference tells the reference's own error, which is
taken off every figure; a figure that is not well above it is marked. Seconds are wall clock, on all cores, the renderer's own start left out.
"""

import json
import subprocess

import numpy as np
import OpenEXR

from ..cache import BIN
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

#: By scene; the others' are by vertex connection and merging.
REFERENCES = {"interior": ["--method", "bdpt"]}

#: Name, options, and the layer to judge ("" is the combined picture).
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
    """Renders for a time and returns what `info` says."""
    command = [
        BIN,
        "render",
        scene,
        "-o",
        out,
        "--width",
        str(options.width),
        "--time",
        str(seconds),
        "--seed",
        str(seed),
    ]
    subprocess.run([*map(str, command), *words, "--progress", "plain"], check=True, stderr=subprocess.DEVNULL)
    return json.loads(subprocess.run([BIN, "info", out, "--json"], check=True, capture_output=True).stdout)


def picture(path, layer):
    """A layer's colours as float64, (height, width, 3)."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        names = [f"{layer}.{c}" if layer else c for c in "RGB"]
        return np.stack([channels[name].pixels.astype(np.float64) for name in names], axis=-1)


def relmse(image, reference):
    """As `caustique compare`: mean of squared difference over squared reference plus 0.01; and without the worst 0.5 % of pixels."""
    pixels = ((image - reference) ** 2 / (reference**2 + 0.01)).mean(axis=-1).ravel()
    keep = np.sort(pixels)[: len(pixels) - int(0.005 * len(pixels))]
    return np.array([pixels.mean(), keep.mean()])


def add_arguments(parser):
    parser.add_argument("--keep", action="store_true", help="take references that are there already")


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    for scene in options.scenes:
        file = ROOT / "scenes" / f"{scene}.glb"
        halves = []
        for seed in (1001, 1002):
            half = OUT / f"{scene}-reference-{seed}.exr"
            words = REFERENCES.get(scene, ["--method", "vcm", "--levels", "1"])
            if not (options.keep and half.exists()):
                render(file, half, options.reference_seconds, seed, [*words, "--no-combine"])
            halves.append(picture(half, "Noisy"))
        reference = (halves[0] + halves[1]) / 2
        # Of the mean: half the variance of one half, which is half of that of the difference.
        own = relmse(halves[0], halves[1]) / 4
        print(
            f"{scene}, {reference.shape[1]} x {reference.shape[0]}, {options.seconds:g} s each; the reference's own relMSE is {own[0]:.2g}"
        )
        print(
            f"{'':<18}{'iterations':>11}{'relMSE':>11}{'trimmed':>11}{'core-s per million light paths':>33}{'eye paths':>11}"
        )
        rows = []
        for name, words, layer in METHODS:
            errors, infos = [], []
            for seed in range(options.seeds):
                out = OUT / f"{scene}-{name.replace(', ', '-').replace(' ', '-')}.exr"
                infos.append(
                    render(file, out, options.seconds, seed, words if layer != "Noisy" else [*words, "--no-combine"])
                )
                errors.append(relmse(picture(out, layer), reference))
            error = np.mean(errors, axis=0) - own
            last = infos[-1]["history"][-1]
            pairs = 2 if infos[-1]["arguments"]["levels"] != 1 and name.split(",")[0] in ("sppm", "vcm") else 1
            eye_paths = reference.shape[0] * reference.shape[1] * last["iterations"] * pairs
            costs = [last["cpu_seconds"] / n * 1e6 if n else None for n in (last["light_paths"], eye_paths)]
            marks = ["" if e > 3 * o else "*" for e, o in zip(error, own)]
            shown = "".join(f"{f'{e:.3g}{mark}':>11}" for e, mark in zip(error, marks))
            light, eye = ("-" if c is None else f"{c:.2f}" for c in costs)
            print(f"{name:<18}{last['iterations']:>11}{shown}{light:>33}{eye:>11}", flush=True)
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
        record(
            "equal-time",
            {
                "scene": scene,
                "seconds": options.seconds,
                "width": options.width,
                "reference_relmse": own[0],
                "methods": rows,
            },
        )
