"""Trains the shipped network from scratch: data, training, evaluation, export, fixture. It takes three quarters of an hour
on one core; each step continues where it stopped.

It needs the virtual environment that scripts/lab/train/README.md describes.
"""

import subprocess
import sys
from pathlib import Path

from ..cache import BIN
from ..options import options
from ..record import ROOT

VENV = ".venv-train"
ARGUMENTS = {"threads": 1}
SEEN = ["cornell", "torus", "pool", "interior", "stadium", "fog"]
# Two scenes without training data, and two training scenes from their own cameras.
HELD_OUT = ["gems", "lamp", "cornell", "pool"]
NETWORK = ROOT / "src" / "combine" / "models" / "compact.onnx"


def add_arguments(parser):
    parser.add_argument("folder", type=Path, help="folder of the data and the checkpoints, about 60 MB")


def step(module, *words):
    """Runs a step of lab/train."""
    subprocess.run([sys.executable, "-m", f"lab.train.{module}", *map(str, words)], check=True)


def data(variants, renders, iterations, reference, scenes):
    """Renders stacks and references of scenes."""
    size = ["--width", 128, "--height", 72, "--side", 0, "-o", options.folder / "data"]
    counts = ["--variants", variants, "--renders", renders]
    counts += ["--iterations", *iterations, "--reference-iterations", reference]
    files = [ROOT / "scenes" / f"{scene}.glb" for scene in scenes]
    step("data", "--caustique", BIN, "--threads", options.threads, *size, *counts, *files)


def main():
    folder, threads = options.folder, ["--threads", options.threads]
    folder.mkdir(parents=True, exist_ok=True)
    data(1, 4, [4, 8, 16, 64], 160, SEEN)
    data(0, 2, [4, 64], 240, HELD_OUT)
    data(2, 4, [4, 16, 32, 8], 160, SEEN)
    synthetic, first, last = folder / "synthetic", folder / "pre", folder / "run"
    if not synthetic.is_dir():
        step("synthetic", "-o", synthetic, "--count", 240)
    # These minutes gave the steps that src/combine/models/compact.txt lists, on one core with other work.
    rate = ["--batch", 4, "--rate", 1e-3, *threads]
    step("train", "--data", synthetic, "--out", first, "--side", 48, *rate, "--minutes", 12)
    both = ["--data", folder / "data", synthetic, "--init", first / "last.pt"]
    step("train", *both, "--out", last, "--squared", 0.5, "--side", 56, *rate, "--minutes", 11)
    checkpoint = ["--checkpoint", last / "last.pt"]
    step("evaluate", *checkpoint, "--data", folder / "data")
    step("export_network", *checkpoint, "-o", NETWORK)
    step("fixture", *checkpoint)
