"""The rendered views (data.py) as training samples and as items for validation, mapped into memory."""

import functools
import math
import time
import zipfile
from pathlib import Path

import numpy as np

from . import normalise
from .data import PATHS, independent_file, manifest
from .pairs import PAIRS

# Arrays of a window that all of its snapshots share.
TARGETS = ("halves", "clean")
# Arrays without a last axis of colour or direction; others have one.
PLANAR = ("deviations", "deviation", "pair_deviations", "radius", "depth", "effects", "correlation", "transmission")
# Stacks of which a pool keeps the files open.
OPEN = 128
# Arrays without radiance, and the one whose last axis is a direction.
DIMENSIONLESS = ("radius", "depth", "albedo", "normal", "iterations", "correlation", "transmission")
# Standard deviation of the logarithm of the random factor on radiance: exposures of crops differ from their pictures'.
EXPOSURE_SPREAD = 0.35


def files(folder, held_out, methods=("sppm", "vcm"), paths=(1, 2), pairs="multi"):
    """Stems (folder of a view, method, seed) of the finished noisy stacks with some numbers of camera paths, of
    held-out views or of all others, that have the pictures of `pairs`."""
    found = []
    for view in manifest(folder).values():
        for file in view["files"] if view["held_out"] == held_out else ():
            method, _, seed = file.removesuffix(".npz").partition("-seed")
            complete = not pairs.startswith("deep") or independent_file(method, seed) in view["files"]
            if seed and complete and method in methods and PATHS[int(seed)] in paths:
                found.append((Path(folder) / "views" / view["view"], method, int(seed)))
    return found


def read(item):
    """Returns the arrays of the noisy pictures of a view, by name, and those of its reference, whose two independent
    halves have the name `halves`."""
    folder, method, seed = item
    arrays = mapped(folder / f"{method}-seed{seed}.npz") | mapped(folder / f"{method}-target.npz")
    independent = folder / independent_file(method, seed)
    if independent.exists():
        arrays |= {f"bdpt_{key}": value for key, value in mapped(independent).items() if key != "iterations"}
    return arrays


def mapped(path):
    """The arrays of an .npz file without compression, as memory maps, which processes share."""
    found, memory = {}, np.memmap(path, np.uint8, "r")
    with zipfile.ZipFile(path) as archive, open(path, "rb") as file:
        for member in archive.infolist():
            # The local header has 26 bytes, two lengths, the name and more; then follows the array with its own header.
            file.seek(member.header_offset + 26)
            lengths = np.frombuffer(file.read(4), "<u2")
            file.seek(int(lengths.sum()), 1)
            np.lib.format.read_magic(file)
            shape, _, dtype = np.lib.format.read_array_header_1_0(file)
            name = member.filename.removesuffix(".npy")
            found[name] = np.ndarray(shape, dtype, memory, file.tell())
    return found


def whole(arrays):
    """Indices of all pixels of a picture."""
    height, width = arrays["depth"].shape[-2:]
    return slice(height), slice(width)


def snapshot(arrays, k, pairs="multi", part=None):
    """Returns the pictures after the k-th stored number of iterations as a stack (normalise.py) of float32, with the
    targets; of a part of the pixels (slices of rows and columns) if given."""
    rows, columns = part or whole(arrays)
    stack = {}
    for key, value in arrays.items():
        if key == "iterations":
            stack[key] = value[k]
            continue
        value = value if key in TARGETS else value[k]
        pixels = (..., rows, columns) if key.removeprefix("bdpt_") in PLANAR else (..., rows, columns, slice(None))
        stack[key] = value[pixels].astype(np.float32)
    stack["depth"] = np.where(stack["depth"] >= 6e4, np.inf, stack["depth"])
    if pairs.startswith("deep"):
        several = pairs == "deep-multi"
        stack["independent"] = stack["bdpt_quarters"] if several else stack["bdpt_picture"][None]
        stack["correlated"] = stack["quarters"] if several else stack["levels"][3:4]
        stack["pair_deviations"] = np.stack([stack["bdpt_deviation"], stack["deviations"][3]])
    return {key: value for key, value in stack.items() if not key.startswith("bdpt_")}


def random_part(arrays, rng, side):
    """Rows and columns of a random square."""
    height, width = arrays["depth"].shape[-2:]
    side = min(side, height, width)
    y, x = rng.integers(height - side + 1), rng.integers(width - side + 1)
    return slice(y, y + side), slice(x, x + side)


def augment(stack, rng):
    """A stack rotated and mirrored, with permuted colours and a random exposure. Permuting the axes of the normal
    rotates or mirrors it."""
    turns, mirror, order = rng.integers(4), rng.random() < 0.5, rng.permutation(3)
    gain = np.float32(np.exp(rng.normal(0, EXPOSURE_SPREAD)))
    out = {"iterations": stack["iterations"]}
    for key, value in stack.items():
        if key == "iterations":
            continue
        axes = (-2, -1) if key in PLANAR else (-3, -2)
        value = np.rot90(value, turns, axes)
        value = np.flip(value, axes[1]) if mirror else value
        value = value if key in PLANAR else value[..., order]
        out[key] = value if key in DIMENSIONLESS else value * gain
    return out


def sample(stack, pairs, version):
    """Returns the input of a network, the pictures y and z of equation (6), and the halves of the reference: float32
    arrays [c, h, w], [pairs, 3, h, w] twice, and [2, 3, h, w]. Views are stored with
    the exposure of their picture, so the scales are 1."""
    y, z = PAIRS[pairs].of(stack)
    planar = lambda pictures: np.ascontiguousarray(np.moveaxis(pictures, -1, -3), np.float32)
    return normalise.tensor(stack, 1, 1, version), planar(y), planar(z), planar(stack["halves"])


class Pool:
    """Random samples of all stacks; those that are finished later join within a minute."""

    def __init__(self, folder, methods, paths, pairs):
        self.folder, self.methods, self.paths, self.pairs = folder, methods, paths, pairs
        self.known, self.looked = [], -math.inf
        self.read = functools.lru_cache(OPEN)(self.open)

    open = staticmethod(read)

    def files(self):
        """The stacks of the training views."""
        return files(self.folder, False, self.methods, self.paths, self.pairs)

    def sample(self, arrays, rng, side, version):
        """The arrays of one random sample of a stack."""
        part = random_part(arrays, rng, side)
        stack = snapshot(arrays, rng.integers(len(arrays["iterations"])), self.pairs, part)
        return sample(augment(stack, rng), self.pairs, version)

    def batch(self, rng, count, side, version):
        """Arrays of `count` random samples."""
        if time.monotonic() - self.looked > 60:
            self.known, self.looked = self.files(), time.monotonic()
        if not self.known:
            raise SystemExit(f"{self.folder}: no views to train with; render some with scripts/lab.sh training_data")
        chosen = []
        for _ in range(count):
            arrays = self.read(self.known[rng.integers(len(self.known))])
            chosen.append(self.sample(arrays, rng, side, version))
        return [np.stack(part) for part in zip(*chosen)]
