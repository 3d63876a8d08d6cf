"""The rendered views (data.py) as training samples and as items for validation, in memory a few at a time."""

from pathlib import Path

import numpy as np

from . import normalise
from .data import PATHS, independent_file, manifest
from .pairs import PAIRS

# Arrays without a last axis of colour or direction; others have one.
PLANAR = ("deviations", "pair_deviations", "radius", "depth")
# Arrays without radiance, and the one whose last axis is a direction.
DIMENSIONLESS = ("radius", "depth", "albedo", "normal", "iterations")
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
    """The arrays of a noisy stack, by snapshot, and `halves` of its target."""
    folder, method, seed = item
    with np.load(folder / f"{method}-seed{seed}.npz") as stored:
        arrays = dict(stored)
    with np.load(folder / f"{method}-target.npz") as stored:
        arrays["halves"] = stored["halves"]
    independent = folder / independent_file(method, seed)
    if independent.exists():
        with np.load(independent) as stored:
            arrays |= {f"bdpt_{key}": value for key, value in stored.items()}
    return arrays


def snapshot(arrays, k, pairs="multi"):
    """Snapshot k as a stack (normalise.py) in float32, with `halves`."""
    stack = {key: value[k].astype(np.float32) for key, value in arrays.items() if key not in ("halves", "iterations")}
    stack["depth"] = np.where(stack["depth"] >= 6e4, np.inf, stack["depth"])
    stack |= {"halves": arrays["halves"].astype(np.float32), "iterations": arrays["iterations"][k]}
    if pairs.startswith("deep"):
        several = pairs == "deep-multi"
        stack["independent"] = stack["bdpt_quarters"] if several else stack["bdpt_picture"][None]
        stack["correlated"] = stack["quarters"] if several else stack["levels"][3:4]
        stack["pair_deviations"] = np.stack([stack["bdpt_deviation"], stack["deviations"][3]])
    return {key: value for key, value in stack.items() if not key.startswith("bdpt_")}


def augment(stack, rng, side):
    """A random part, rotated and mirrored, with permuted colours and a random exposure. Permuting the axes of the
    normal rotates or mirrors it."""
    h, w = stack["depth"].shape
    side = min(side, h, w)
    y, x = rng.integers(h - side + 1), rng.integers(w - side + 1)
    turns, mirror, order = rng.integers(4), rng.random() < 0.5, rng.permutation(3)
    gain = np.float32(np.exp(rng.normal(0, EXPOSURE_SPREAD)))
    out = {"iterations": stack["iterations"]}
    for key, value in stack.items():
        if key == "iterations":
            continue
        axes = (-2, -1) if key in PLANAR else (-3, -2)
        cut = (..., slice(y, y + side), slice(x, x + side)) + (() if key in PLANAR else (slice(None),))
        value = np.rot90(value[cut], turns, axes)
        value = np.flip(value, axes[1]) if mirror else value
        value = value if key in PLANAR else value[..., order]
        out[key] = value if key in DIMENSIONLESS else value * gain
    return out


def sample(stack, pairs, version):
    """(input, y, z, halves): float32 arrays [c, h, w], [pairs, 3, h, w] twice, and [2, 3, h, w]. Views are stored with
    the exposure of their picture, so the scales are 1."""
    y, z = PAIRS[pairs].of(stack)
    planar = lambda pictures: np.ascontiguousarray(np.moveaxis(pictures, -1, -3), np.float32)
    return normalise.tensor(stack, 1, 1, version), planar(y), planar(z), planar(stack["halves"])


class Pool:
    """Some stacks in memory, of which each batch replaces a few; a part of the data that is finished later joins
    then."""

    def __init__(self, folder, methods, paths, pairs, size=48):
        self.folder, self.methods, self.paths, self.pairs, self.size = folder, methods, paths, pairs, size
        self.loaded = []

    def batch(self, rng, count, side, version):
        """Arrays of `count` random samples."""
        known = files(self.folder, False, self.methods, self.paths, self.pairs)
        if not known:
            raise SystemExit(f"{self.folder}: no views to train with; render some with scripts/lab.sh training_data")
        wanted = 1 if len(self.loaded) >= min(self.size, len(known)) else 4
        for _ in range(wanted):
            self.loaded.append(read(known[rng.integers(len(known))]))
        self.loaded = self.loaded[-self.size :]
        chosen = []
        for _ in range(count):
            arrays = self.loaded[rng.integers(len(self.loaded))]
            stack = snapshot(arrays, rng.integers(len(arrays["iterations"])), self.pairs)
            chosen.append(sample(augment(stack, rng, side), self.pairs, version))
        return [np.stack(part) for part in zip(*chosen)]
