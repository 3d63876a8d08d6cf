"""Training crops on disk: small, and free of light and scene units.

Every crop is scaled by the exposure and the median depth of the whole image that it comes from, so that it can stand
for its part of that image; variances are averaged over RGB and kept as deviations; all is float16 (relative error
0.0005, far below the noise). Files are named SCENE--VARIANT-ANYTHING.npz.
"""

import pathlib

import numpy as np

from . import normalise

# Scenes never trained on.
HELD_OUT = ("gems", "lamp")

LARGEST = 6e4  # float16 ends at 65504


def save(path, stack, box=None):
    """Write the part `box` = (y0, x0, side) of a stack (see normalise.py) with its `reference`; False if it is unfit."""
    scale, middle = normalise.exposure(stack["levels"]), normalise.median_depth(stack["depth"])
    y, x, side = box or (0, 0, None)
    cut = np.s_[..., y : y + side, x : x + side] if side else np.s_[...]
    colour = np.s_[..., y : y + side, x : x + side, :] if side else np.s_[...]
    levels, reference = stack["levels"][colour] * scale, stack["reference"][colour] * scale
    if not (np.isfinite(levels).all() and np.isfinite(reference).all()) or max(levels.max(), reference.max()) > LARGEST:
        return False
    deviations = np.sqrt(np.maximum(normalise.finite(stack["variances"][colour]), 0).mean(-1)) * scale
    depth = stack["depth"][cut] / middle
    depth = np.where(np.isfinite(depth) & (stack["depth"][cut] < normalise.BACKGROUND_DEPTH), depth, np.inf)
    arrays = {
        "levels": levels,
        "deviations": deviations.clip(0, LARGEST),
        "albedo": normalise.finite(stack["albedo"][colour]),
        "normal": normalise.finite(stack["normal"][colour]),
        "depth": np.where(depth < LARGEST, depth, np.inf),
        "reference": reference,
    }
    np.savez_compressed(path, **{k: v.astype(np.float16) for k, v in arrays.items()})
    return True


def load(path):
    """(input tensor, levels [m, 3, h, w], reference [3, h, w]), float32."""
    crop = {k: v.astype(np.float32) for k, v in np.load(path).items()}
    crop["variances"] = crop.pop("deviations")[..., None] ** 2
    image = normalise.tensor(crop, scale=1, middle=1)
    return image, crop["levels"].transpose(0, 3, 1, 2), crop["reference"].transpose(2, 0, 1)


def files(folder):
    """{scene: [files]} of SCENE--VARIANT-ANYTHING.npz, sorted."""
    scenes = {}
    for file in sorted(pathlib.Path(folder).glob("*.npz")):
        scenes.setdefault(file.stem.split("--")[0], []).append(file)
    return scenes


def held_out(scenes, names):
    """{scene: [files]} never to train on: all of the scenes `names`, and variant 0 (the scene as it is) of every other."""
    chosen = {
        s: [f for f in files if s in names or f.stem.split("--")[1].split("-")[0] == "0"] for s, files in scenes.items()
    }
    return {s: files for s, files in chosen.items() if files}
